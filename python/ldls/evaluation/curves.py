"""Tables of scores along an axis: the maximum range, or the number of iterations."""

from __future__ import annotations

from collections.abc import Mapping

from ldls.evaluation.evaluate import Evaluation
from ldls.evaluation.tables import PERCENT, Cell, Table, percent


def range_table(by_range: Mapping[float, Evaluation]) -> Table:
    """Precision, recall and IoU of each class over the points up to each maximum range (the paper's range figures)."""
    rows = []
    for limit_m, found in by_range.items():
        for name in found.names:
            counts = found.semantic[name]
            scores = (percent(score) for score in (counts.precision, counts.recall, counts.iou))
            rows.append((f"{limit_m:g}", name, counts.tp + counts.fn, *scores))
    columns = ("maximum range, m", "class", "true points", "precision", "recall", "IoU")
    return Table("Points by maximum range", columns, tuple(rows), PERCENT)


def iteration_table(by_iterations: Mapping[int, Evaluation]) -> Table:
    """IoU of each class and their mean after each number of iterations."""
    names = next(iter(by_iterations.values())).names if by_iterations else ()
    rows: list[tuple[Cell, ...]] = []
    for count, found in by_iterations.items():
        scores = (percent(found.semantic[name].iou) for name in names)
        rows.append((count, *scores, percent(found.semantic.mean_iou)))
    columns = ("iterations", *(f"{name} IoU" for name in names), "mean IoU")
    return Table("Points by number of iterations", columns, tuple(rows), PERCENT)
