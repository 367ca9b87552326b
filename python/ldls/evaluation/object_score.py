"""How well single objects were found, for plots against their range."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.errors import InputError
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.instance import best_matches, instance_overlaps, matched_iou
from ldls.evaluation.pair import Pair


@dataclass(frozen=True)
class ObjectScore:
    """How well one true instance was overlap.

    Attributes:
        frame: Name of the frame.
        name: Class.
        instance: Its number.
        n_points: Its points that count.
        range_m: Mean distance of these points from the lidar, in metres.
        iou: IoU with the matched prediction; 0 for none.
    """

    frame: str
    name: str
    instance: int
    n_points: int
    range_m: float
    iou: float


def object_scores(pair: Pair, *, classes: ClassSet) -> tuple[ObjectScore, ...]:
    """IoU and range of every true instance of the scored classes in a frame with `ranges_m`.

    Raises:
        InputError: The pair has no ranges, or its truth an unknown class.
    """
    if pair.ranges_m is None:
        raise InputError(f"frame {pair.name}: the ranges of objects need the points' ranges_m, got none")
    mapped = pair.mapped(classes)
    return tuple(score for name in classes.names for score in _objects(mapped, name, np.asarray(pair.ranges_m)))


def _objects(pair: Pair, name: str, ranges_m: NDArray[np.floating]) -> Iterator[ObjectScore]:
    overlap = instance_overlaps(pair.prediction, pair.truth, name)
    iou = matched_iou(overlap, best_matches(overlap))
    k = pair.truth.names.index(name)
    counted = (pair.truth.classes == k) & ~(pair.truth.ignored | pair.prediction.ignored)
    for instance, n_points, score in zip(overlap.truth_ids.tolist(), overlap.truth_points.tolist(), iou, strict=True):
        range_m = float(ranges_m[counted & (pair.truth.instances == instance)].mean(dtype=np.float64))
        yield ObjectScore(pair.name, name, instance, n_points, range_m, float(score))
