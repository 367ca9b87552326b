"""Instances matched within their class: their precision and recall, and the score of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.checks import checked, whole_number
from ldls.errors import InputError, ParameterError
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.counts import Counts
from ldls.evaluation.pair import Pair
from ldls.evaluation.semantic import check_vocabulary
from ldls.labeling import Labeling

PAPER_THRESHOLDS = (0.5, 0.7)


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Overlaps of T true with P predicted segments.

    Attributes:
        truth_ids: (T,) numbers of the true segments, ascending.
        prediction_ids: (P,) numbers of the predicted segments, ascending.
        truth_points: (T,) int64: points of each true segment.
        prediction_points: (P,) int64: points of each predicted segment.
        common: (T, P) int64: points in both.
        iou: (T, P) float64: points in both over points in either.
    """

    truth_ids: NDArray[np.signedinteger]
    prediction_ids: NDArray[np.signedinteger]
    truth_points: NDArray[np.int64]
    prediction_points: NDArray[np.int64]
    common: NDArray[np.int64]
    iou: NDArray[np.float64]


class InstanceScores:
    """Instances found, invented and missed, added up frame by frame.

    In each frame and class, true and predicted instances are matched one to one such that the sum of IoUs is largest;
    a match is true from a threshold of IoU on.

    Points that either labeling ignores are dropped before, and so are points of a scored class whose truth names no
    instance: they tell nothing of instances. True instances of fewer than `minimum_points` points are left out, and a
    prediction that matches one is neither right nor wrong.

    Attributes:
        names: The scored classes.
        thresholds: IoU from which on a match is true.
        minimum_points: Points from which on a true instance counts.
    """

    @checked
    def __init__(
        self, names: Sequence[str], *, thresholds: Sequence[float] = PAPER_THRESHOLDS, minimum_points: int = 0
    ) -> None:
        """Start without an instance.

        Raises:
            ParameterError: A threshold is not in (0, 1], or `minimum_points` is negative.
        """
        for threshold in thresholds:
            if not 0 < threshold <= 1:
                raise ParameterError(f"thresholds: got {threshold}, expected more than 0 and at most 1")
        self.names = tuple(names)
        self.thresholds = tuple(thresholds)
        self.minimum_points = whole_number("minimum_points", minimum_points, 0)
        self._counts = {(name, threshold): Counts() for name in self.names for threshold in self.thresholds}

    @checked
    def add(self, prediction: Labeling, truth: Labeling) -> None:
        """Count the instances of a frame; both labelings mapped to these classes."""
        check_vocabulary(self.names, prediction, truth)
        for name in self.names:
            overlap = instance_overlaps(prediction, truth, name)
            matched = best_matches(overlap)
            for threshold in self.thresholds:
                self._counts[name, threshold] += _count(overlap, matched, threshold, self.minimum_points)

    def __getitem__(self, key: tuple[str, float]) -> Counts:
        """Instances of (class name, threshold) found, invented and missed."""
        return self._counts[key]


def overlaps(prediction: NDArray[np.signedinteger], truth: NDArray[np.signedinteger]) -> Overlaps:
    """Overlaps of the segments of `prediction` and `truth`, each (n,), where -1 is no segment."""
    truth_ids, truth_rows = np.unique(truth, return_inverse=True)
    prediction_ids, prediction_rows = np.unique(prediction, return_inverse=True)
    shape = len(truth_ids), len(prediction_ids)
    cells = truth_rows.reshape(-1) * shape[1] + prediction_rows.reshape(-1)
    # the table has the points without a segment as well, so that its sums are whole segments
    both = np.bincount(cells, minlength=shape[0] * shape[1]).reshape(shape)
    true, predicted = truth_ids >= 0, prediction_ids >= 0
    truth_points = both.sum(axis=1)[true]
    prediction_points = both.sum(axis=0)[predicted]
    common = both[true][:, predicted]
    iou = common / (truth_points[:, None] + prediction_points[None, :] - common)
    return Overlaps(truth_ids[true], prediction_ids[predicted], truth_points, prediction_points, common, iou)


def instance_overlaps(prediction: Labeling, truth: Labeling, name: str) -> Overlaps:
    """Overlaps of the instances of the class `name`, by the points that count for instances."""
    k = truth.names.index(name)
    theirs, ours = truth.classes == k, prediction.classes == k
    unknown = (truth.classes > 0) & (truth.instances == 0)
    rows = np.flatnonzero((theirs | ours) & ~(truth.ignored | prediction.ignored | unknown))
    return overlaps(_segments(prediction, k, rows), _segments(truth, k, rows))


def best_matches(overlap: Overlaps) -> NDArray[np.int64]:
    """(T,) index of the predicted instance matched to each true one, -1 for none; the sum of IoUs is largest."""
    matched = np.full(len(overlap.truth_ids), -1, np.int64)
    if overlap.iou.any():
        rows, columns = require("scipy.optimize", "eval").linear_sum_assignment(overlap.iou, maximize=True)
        touching = overlap.iou[rows, columns] > 0
        matched[rows[touching]] = columns[touching]
    return matched


def matched_iou(overlap: Overlaps, matched: NDArray[np.int64]) -> NDArray[np.float64]:
    """(T,) IoU of each true instance with its match; 0 for none."""
    iou = np.zeros(len(matched))
    rows = np.flatnonzero(matched >= 0)
    iou[rows] = overlap.iou[rows, matched[rows]]
    return iou


@dataclass(frozen=True)
class ObjectScore:
    """Score of one true instance.

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


@checked
def object_scores(pair: Pair, *, classes: ClassSet) -> tuple[ObjectScore, ...]:
    """IoU and range of every true instance of the scored classes in a frame with `ranges_m`.

    Raises:
        InputError: The pair has no ranges, or its truth an unknown class.
    """
    if pair.ranges_m is None:
        raise InputError(f"frame {pair.name}: the ranges of objects need the points' ranges_m, got none")
    mapped = pair.mapped(classes)
    return tuple(score for name in classes.names for score in _objects(mapped, name, np.asarray(pair.ranges_m)))


def _segments(labeling: Labeling, k: int, rows: NDArray[np.intp]) -> NDArray[np.int32]:
    instances = labeling.instances[rows]
    return np.where((labeling.classes[rows] == k) & (instances > 0), instances, -1).astype(np.int32)


def _count(overlap: Overlaps, matched: NDArray[np.int64], threshold: float, minimum_points: int) -> Counts:
    true = matched_iou(overlap, matched) >= threshold
    counts = overlap.truth_points >= minimum_points
    tp = int((true & counts).sum())
    # a true match with an instance too small to count takes its prediction out of the false positives
    return Counts(tp, len(overlap.prediction_ids) - int(true.sum()), int(counts.sum()) - tp)


def _objects(pair: Pair, name: str, ranges_m: NDArray[np.floating]) -> Iterator[ObjectScore]:
    overlap = instance_overlaps(pair.prediction, pair.truth, name)
    iou = matched_iou(overlap, best_matches(overlap))
    k = pair.truth.names.index(name)
    counted = (pair.truth.classes == k) & ~(pair.truth.ignored | pair.prediction.ignored)
    for instance, n_points, score in zip(overlap.truth_ids.tolist(), overlap.truth_points.tolist(), iou, strict=True):
        range_m = float(ranges_m[counted & (pair.truth.instances == instance)].mean(dtype=np.float64))
        yield ObjectScore(pair.name, name, instance, n_points, range_m, float(score))
