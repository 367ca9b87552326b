"""Tables of scores, for the screen and for files."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ldls.checks import checked
from ldls.errors import ParameterError
from ldls.evaluation.evaluation import WELL_SEEN_POINTS, Evaluation
from ldls.evaluation.reliability import BINS
from ldls.evaluation.tracking import TrackingQuality, TrackingScores
from ldls.io.files import whole_file

if TYPE_CHECKING:
    from rich.table import Table as RichTable

Cell = str | int | float | None
UNDEFINED = "-"
NO_SUCH_SCORE = ""
"""Cell of a row that has no score of the column, as the precision of a mean."""
SHOWN_THRESHOLDS = (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
PERCENT = "Scores in percent; '-': neither truth nor prediction has the class."


@checked
@dataclass(frozen=True)
class Table:
    """A table of scores.

    Attributes:
        title: Its title.
        columns: Heads of the columns.
        rows: Cells: text, whole numbers, numbers shown with one decimal, None where there is nothing to score, or ""
            where the row has no score of the column.
        note: A note to the reader, shown below.

    Raises:
        ParameterError: A row has not a cell for each column, or a number is not finite.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ParameterError(f"rows: expected {len(self.columns)} cells, got {row}")
            if any(isinstance(cell, float) and not math.isfinite(cell) for cell in row):
                raise ParameterError(f"rows: expected finite numbers, got {row}; None means not defined")

    def markdown(self) -> str:
        """The table in Markdown, title above and note below."""
        align = ["---:" if self._is_number(c) else ":---" for c in range(len(self.columns))]
        lines = [self.columns, align, *(tuple(map(_shown, row)) for row in self.rows)]
        grid = "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines)
        return "\n\n".join(part for part in (f"**{self.title}**", grid, self.note) if part) + "\n"

    def csv(self) -> str:
        """The heads and rows as comma-separated values, numbers in full and empty where not defined."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerows([self.columns, *self.rows])
        return text.getvalue()

    def json(self) -> str:
        """Title, note and one object a row, numbers in full and null where not defined."""
        cells = [[None if cell == NO_SUCH_SCORE else cell for cell in row] for row in self.rows]
        rows = [dict(zip(self.columns, row, strict=True)) for row in cells]
        content = {"title": self.title, "note": self.note, "rows": rows}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def rich(self) -> RichTable:
        """The table for a terminal; `print(..., crop=False)` where that may be narrower than its words and numbers."""
        from rich.table import Table as RichTable
        from rich.text import Text

        grid = RichTable(title=self.title, caption=self.note or None)
        for c, column in enumerate(self.columns):
            is_number = self._is_number(c)
            words = [word for row in self.rows for word in _shown(row[c]).split()]
            # heads of numbers, and names where the terminal is narrow, fold between words
            widest = max(map(len, [*words, *column.split()]))
            grid.add_column(
                Text(column),
                justify="right" if is_number else "left",
                overflow="fold",
                min_width=widest,
                max_width=widest if is_number else None,
            )
        for row in self.rows:
            grid.add_row(*(Text(_shown(cell)) for cell in row))
        return grid

    def write(self, folder: str | PathLike[str], stem: str) -> list[Path]:
        """Write `stem` .md, .csv and .json to `folder`, made if need be; the files written."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        paths = table_files(folder, stem)
        for path, content in zip(paths, (self.markdown(), self.csv(), self.json()), strict=True):
            with whole_file(path) as file:
                file.write(content.encode())
        return paths

    def _is_number(self, column: int) -> bool:
        texts = (row[column] for row in self.rows if isinstance(row[column], str))
        return bool(self.rows) and all(text == NO_SUCH_SCORE for text in texts)


def table_files(folder: Path, *stems: str) -> list[Path]:
    """The files that `Table.write` writes of each stem."""
    return [folder / f"{stem}{suffix}" for stem in stems for suffix in (".md", ".csv", ".json")]


@checked
def semantic_table(evaluations: Mapping[str, Evaluation]) -> Table:
    """Precision, recall and IoU of each class by method, over all points (Table I of the paper)."""
    names = _classes(evaluations)
    rows: list[tuple[Cell, ...]] = []
    for method, evaluation in evaluations.items():
        rows += [(method, *scores) for scores in _class_scores(evaluation)]
        if len(names) > 1:
            rows.append((method, "mean", *[NO_SUCH_SCORE] * 3, percent(evaluation.semantic.mean_iou)))
    columns = ("method", "class", "true points", "precision", "recall", "IoU")
    return Table("Points by class", columns, tuple(rows), PERCENT)


@checked
def instance_table(evaluations: Mapping[str, Evaluation]) -> Table:
    """Instances found, invented and missed at each threshold of IoU, by method and class (Table II)."""
    rows: list[tuple[Cell, ...]] = []
    for method, evaluation in evaluations.items():
        for name in evaluation.names:
            for threshold in evaluation.instance.thresholds:
                c = evaluation.instance[name, threshold]
                recalls = percent(c.recall), percent(evaluation.well_seen[name, threshold].recall)
                rows.append((method, name, f"{threshold:.2f}", c.tp, c.fp, c.fn, percent(c.precision), *recalls))
    columns = ("method", "class", "IoU from", "TP", "FP", "FN", "precision", "recall", f"recall {WELL_SEEN_POINTS}+")
    return Table("Instances", columns, tuple(rows), f"{PERCENT} {WELL_SEEN_POINTS}+: of instances of so many points.")


@checked
def panoptic_table(evaluations: Mapping[str, Evaluation]) -> Table:
    """Panoptic, segmentation and recognition quality by method and class, and the mean of the classes."""
    rows: list[tuple[Cell, ...]] = []
    for method, evaluation in evaluations.items():
        for name in evaluation.names:
            q = evaluation.panoptic[name]
            scores = percent(q.pq), percent(q.sq), percent(q.rq)
            rows.append((method, name, *scores, q.counts.tp, q.counts.fp, q.counts.fn))
        if len(evaluation.names) > 1:
            rows.append((method, "mean", percent(evaluation.panoptic.mean_pq), *[NO_SUCH_SCORE] * 5))
    columns = ("method", "class", "PQ", "SQ", "RQ", "TP", "FP", "FN")
    return Table("Panoptic quality", columns, tuple(rows), PERCENT)


@checked
def tracking_table(scores: Mapping[str, TrackingScores]) -> Table:
    """Association scores by method: of each class and, where there are several, of all together."""
    rows: list[tuple[Cell, ...]] = []
    for method, each in scores.items():
        names = each.names if len(each.names) > 1 else ()
        for name in names:
            quality = percent(each.semantic[name].iou), *_association(each[name])
            rows.append((method, name, NO_SUCH_SCORE, *quality))
        whole = "all" if names else each.names[0]
        rows.append((method, whole, percent(each.lstq), percent(each.s_cls), *_association(each.total)))
    columns = (
        *("method", "class", "LSTQ", "S_cls", "S_assoc", "objects", "object frames"),
        *("id switches", "a hundred frames", "MOTSA"),
    )
    note = (
        "Scores in percent; '-': there is no true object, and for S_cls, of a class its IoU, no predicted one either. "
        "Object frames: true objects in each sweep, matched or not."
    )
    return Table("Objects over the drive", columns, tuple(rows), note)


@checked
def ablation_table(evaluations: Mapping[str, Evaluation]) -> Table:
    """IoU of each class by variant, the gain in mean IoU over the first (Table III), and mean panoptic quality."""
    names = _classes(evaluations)
    rows: list[tuple[Cell, ...]] = []
    first: float | None = None
    for variant, evaluation in evaluations.items():
        mean = percent(evaluation.semantic.mean_iou)
        first = mean if not rows else first
        gain = None if mean is None or first is None else mean - first
        pq = percent(evaluation.panoptic.mean_pq)
        rows.append((variant, *(percent(evaluation.semantic[name].iou) for name in names), mean, gain, pq))
    columns = ("variant", *(f"{name} IoU" for name in names), "mean IoU", "gain", "mean PQ")
    return Table("Ablation", columns, tuple(rows), f"{PERCENT} Gain: points of mean IoU over the first row.")


@checked
def frame_table(evaluation: Evaluation) -> Table:
    """Points, those that count, and IoU of each class, by frame."""
    names = evaluation.names
    rows = [
        (f.name, f.n_points, f.n_counted, *(percent(f.classes[name].iou) for name in names)) for f in evaluation.frames
    ]
    columns = ("frame", "points", "counted", *(f"{name} IoU" for name in names))
    return Table("Frames", columns, tuple(rows), PERCENT)


@checked
def range_table(by_range: Mapping[float, Evaluation]) -> Table:
    """Precision, recall and IoU of each class over the points up to each maximum range (the paper's range figures)."""
    rows = [(f"{limit_m:g}", *scores) for limit_m, each in by_range.items() for scores in _class_scores(each)]
    columns = ("maximum range, m", "class", "true points", "precision", "recall", "IoU")
    return Table("Points by maximum range", columns, tuple(rows), PERCENT)


@checked
def iteration_table(by_iterations: Mapping[int, Evaluation]) -> Table:
    """IoU of each class and their mean after each number of iterations."""
    names = next(iter(by_iterations.values())).names if by_iterations else ()
    rows: list[tuple[Cell, ...]] = []
    for count, evaluation in by_iterations.items():
        scores = (percent(evaluation.semantic[name].iou) for name in names)
        rows.append((count, *scores, percent(evaluation.semantic.mean_iou)))
    columns = ("iterations", *(f"{name} IoU" for name in names), "mean IoU")
    return Table("Points by number of iterations", columns, tuple(rows), PERCENT)


@checked
def reliability_table(evaluations: Mapping[str, Evaluation]) -> Table:
    """Mean confidence, share of right labels and calibration error, by method that tells a confidence."""
    rows: list[tuple[Cell, ...]] = []
    for method, evaluation in evaluations.items():
        told = evaluation.reliability
        for kind, bins in {"in view": told.points, "of objects": told.objects}.items() if told else ():
            n = int(bins.points.sum())
            means = [float(each.sum() / n) if n else None for each in (bins.confidence, bins.right)]
            rows.append((method, kind, n, *map(percent, (*means, bins.calibration_error))))
    columns = ("method", "points", "number", "confidence", "right", "calibration error")
    note = f"In percent. Calibration error: mean distance of right from confidence, in {BINS} bins."
    return Table("Reliability", columns, tuple(rows), note)


@checked
def coverage_table(evaluations: Mapping[str, Evaluation]) -> Table:
    """Points of objects that are at least so sure, and the precision of these, by method that tells a confidence."""
    rows: list[tuple[Cell, ...]] = []
    for method, evaluation in evaluations.items():
        curve = evaluation.reliability.by_threshold.from_thresholds() if evaluation.reliability else ()
        rows += [(method, f"{row[0]:.2f}", *map(percent, row[1:])) for row in curve if row[0] in SHOWN_THRESHOLDS]
    columns = ("method", "confidence from", "coverage", "precision")
    note = "In percent. Coverage: share of the points labelled as objects that are kept."
    return Table("Points of objects by confidence", columns, tuple(rows), note)


def _association(quality: TrackingQuality) -> tuple[Cell, ...]:
    counts = quality.tubes, quality.object_frames, quality.id_switches, quality.switches_per_100
    return percent(quality.s_assoc), *counts, percent(quality.motsa)


def _class_scores(evaluation: Evaluation) -> Iterator[tuple[str, int, *tuple[float | None, ...]]]:
    """Name, true points, precision, recall and IoU of each class."""
    for name in evaluation.names:
        counts = evaluation.semantic[name]
        scores = counts.precision, counts.recall, counts.iou
        yield name, counts.tp + counts.fn, *map(percent, scores)


def _classes(evaluations: Mapping[str, Evaluation]) -> tuple[str, ...]:
    sets = {evaluation.names for evaluation in evaluations.values()}
    if len(sets) != 1:
        raise ParameterError(f"evaluations: expected one or more of the same classes, got {sorted(sets)}")
    return sets.pop()


def percent(score: float | None) -> float | None:
    """A score from 0 to 1 in percent; None stays None."""
    return None if score is None else 100 * score


def _shown(cell: Cell) -> str:
    if cell is None:
        return UNDEFINED
    return f"{cell:.1f}" if isinstance(cell, float) else str(cell)
