"""`ldls evaluate`: predictions against truth, from files."""

from __future__ import annotations

from contextlib import suppress
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ldls.cli.messages import console, speaks_plainly
from ldls.cli.options import words
from ldls.cli.progress import progress
from ldls.cli.reliability_files import draw_reliability
from ldls.errors import ParameterError, UnsupportedFormatError

if TYPE_CHECKING:
    from ldls.evaluation import Evaluation

EXISTING = {"exists": True, "readable": True}
FOLDER = {"exists": True, "file_okay": False, "readable": True}
FORMAT_NAMES = "annotations, kitti-boxes, ldls, semantic-kitti, squeezeseg, nuscenes-lidarseg, nuscenes-panoptic"


class Missing(StrEnum):
    """Treatment of frames without their pair."""

    ERROR = "error"
    SKIP = "skip"


@speaks_plainly
def evaluate(
    predictions: Annotated[Path, typer.Argument(help="Labels of a method: a file or a folder.", **EXISTING)],
    truth: Annotated[Path, typer.Argument(help="True labels: a file or a folder.", **EXISTING)],
    classes: Annotated[str, typer.Option(help="Classes to score, separated by commas.")] = "Car,Pedestrian",
    prediction_format: Annotated[
        str | None, typer.Option(help=f"One of {FORMAT_NAMES}.", show_default="by the files' ending")
    ] = None,
    truth_format: Annotated[
        str | None, typer.Option(help="The same for the truth.", show_default="by the files' ending")
    ] = None,
    missing: Annotated[Missing, typer.Option(help="What becomes of a frame without its pair.")] = Missing.ERROR,
    merge_sitting: Annotated[
        bool, typer.Option("--merge-sitting/--keep-sitting", help="Is Person_sitting a Pedestrian, or left out?")
    ] = True,
    leave_out: Annotated[
        str | None,
        typer.Option(help='True classes that do not count; "" for none.', show_default="Van,Cyclist,Misc,DontCare"),
    ] = None,
    background: Annotated[str, typer.Option(help="Names of your own that truth holds and that are background.")] = "",
    max_range: Annotated[float | None, typer.Option(help="Only points this near count, in metres.")] = None,
    min_points: Annotated[int, typer.Option(min=0, help="True instances of fewer points do not count.")] = 0,
    points: Annotated[
        Path | None, typer.Option(help="Folder of the sweeps, for --max-range and kitti-boxes.", **FOLDER)
    ] = None,
    calib: Annotated[Path | None, typer.Option(help="Folder of the calibration, for kitti-boxes.", **FOLDER)] = None,
    images: Annotated[
        Path | None, typer.Option(help="Folder of the images, for their size, for kitti-boxes.", **FOLDER)
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the method.", show_default="that of PREDICTIONS")] = None,
    beside: Annotated[
        list[str] | None, typer.Option(help="NAME=PATH of another method for the same tables; may be repeated.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the tables as Markdown, CSV and JSON.", file_okay=False)
    ] = None,
) -> None:
    """Score the labels of a method against true labels.

    Prints precision, recall and IoU over points, instances found at IoU 0.50 and 0.70, and panoptic quality; of .npz
    results of ldls also how far their confidence can be relied on, and what their masks allow at best. Files belong
    together by name: 000123.npz and 000123.txt.

    Example: ldls evaluate results label_2 --truth-format kitti-boxes --points velodyne --calib calib --out tables
    """
    from ldls.cli.label_pairs import FrameFolders, read_bounds, read_pairs
    from ldls.evaluation import ClassSet, evaluate as score_pairs
    from ldls.evaluation.methods import BOUND
    from ldls.io.labels.label_formats import pair_files

    scored = ClassSet.kitti(
        words(classes),
        merge_sitting=merge_sitting,
        leave_out=None if leave_out is None else words(leave_out),
        background=words(background),
    )
    formats = {"prediction_format": prediction_format, "truth_format": truth_format}
    folders = FrameFolders(points=points, calib=calib, images=images)
    score = partial(score_pairs, classes=scored, max_range_m=max_range, minimum_points=min_points)
    by_method = {}
    for method, path in {name or predictions.stem: predictions, **_named(beside or [])}.items():
        files, lacking = pair_files(path, truth, missing=missing.value, **formats)
        pairs = progress(read_pairs(files, folders=folders, **formats), len(files), "scoring")
        by_method[method] = score(pairs)
        if lacking:
            typer.echo(f"{method}: left out for want of their pair: {_frames(len(lacking))}")
    # labels alone have no masks
    with suppress(UnsupportedFormatError):
        files, _ = pair_files(predictions, truth, missing=missing.value, **formats)
        bounds = read_bounds(files, classes=scored, folders=folders, **formats)
        by_method.setdefault(BOUND, score(progress(bounds, len(files), "bound")))
    _show(by_method, out)


def _named(beside: list[str]) -> dict[str, Path]:
    """Paths of other methods by their names."""
    named = {}
    for text in beside:
        method, equals, path = text.partition("=")
        if not (method and equals and Path(path).exists()):
            raise ParameterError(f"--beside: got {text!r}, expected NAME=PATH with a file or folder that exists")
        named[method] = Path(path)
    return named


def _show(by_method: dict[str, Evaluation], out: Path | None) -> None:
    from ldls.evaluation import tables

    shown = {
        "semantic": tables.semantic_table(by_method),
        "instances": tables.instance_table(by_method),
        "panoptic": tables.panoptic_table(by_method),
    }
    if any(scores.reliability for scores in by_method.values()):
        shown |= {"reliability": tables.reliability_table(by_method), "coverage": tables.coverage_table(by_method)}
    figures: list[Path] = []
    if out:
        for stem, table in shown.items():
            table.write(out, stem)
        tables.frame_table(next(iter(by_method.values()))).write(out, "frames")
        figures = draw_reliability(by_method, out)
    screen = console()
    for table in shown.values():
        screen.print(table.rich())
    for method, scores in by_method.items():
        counted, all_points = (sum(getattr(f, field) for f in scores.frames) for field in ("n_counted", "n_points"))
        counts = f"{_frames(len(scores.frames))}, {counted:,} of {all_points:,} points counted"
        screen.print(counts if len(by_method) == 1 else f"{method}: {counts}", highlight=False)
    if len({sum(f.n_counted for f in scores.frames) for scores in by_method.values()}) > 1:
        screen.print("the methods label different points: their scores do not compare", highlight=False)
    if out:
        written = [f"{', '.join(shown)} and frames as .md, .csv and .json", *(path.name for path in figures)]
        screen.print(f"wrote {', '.join(written)} to {out}", highlight=False, soft_wrap=True)


def _frames(number: int) -> str:
    return "1 frame" if number == 1 else f"{number} frames"
