"""True labels held against the points that they are of."""

from __future__ import annotations

from pathlib import Path

from ldls.cloud import Points
from ldls.errors import InputError
from ldls.labeling import Labeling


def of_points(truth: Labeling, points: Points, path: Path) -> Labeling:
    """`truth`, read from `path`, if it has a label for each point.

    Raises:
        InputError: It has fewer or more.
    """
    if len(truth) != len(points):
        raise InputError(f"{path}: labels: {len(truth):,}, points: {len(points):,}; expected one label a point")
    return truth
