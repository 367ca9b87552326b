"""The figures that tell how far confidence can be relied on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ldls.evaluation import Evaluation


RELIABILITY_FIGURES = ("reliability.png", "coverage.png")


def draw_reliability(evaluations: Mapping[str, Evaluation], out: Path) -> list[Path]:
    """The figures drawn: both if a method tells a confidence and finds an object, else none."""
    from ldls.evaluation import figures

    told = {method: one.reliability for method, one in evaluations.items() if one.reliability}
    if not any(each.objects.points.any() for each in told.values()):
        return []
    paths = [out / name for name in RELIABILITY_FIGURES]
    figures.right_against_confidence(told, paths[0])
    figures.precision_against_coverage(told, paths[1])
    return paths
