"""Confidence held against truth: does a label of 90 % prove right nine times in ten?

A point's label is right when its class, background included, is the true one. The expected calibration error is that of
Guo et al. (On Calibration of Modern Neural Networks, ICML 2017): the mean distance, over the points, of the share that
is right from the mean confidence, bin by bin.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ldls.checks import checked
from ldls.labeling import Labeling

BINS = 15
THRESHOLDS = 100


class Bins:
    """Points in bins of equal width by their confidence, added up frame by frame.

    Attributes:
        edges: (B,) confidence from which on a point is in each bin; those of 1 are in the last.
        points: (B,) int64: points in each bin.
        right: (B,) int64: those whose label is right.
        confidence: (B,) float64: sum of their confidences.
    """

    def __init__(self, number: int) -> None:
        """Start without a point."""
        self.edges: NDArray[np.float64] = np.arange(number) / number
        self.points: NDArray[np.int64] = np.zeros(number, np.int64)
        self.right: NDArray[np.int64] = np.zeros(number, np.int64)
        self.confidence: NDArray[np.float64] = np.zeros(number)

    def add(self, confidence: NDArray[np.floating], right: NDArray[np.bool_]) -> None:
        """Count points, (n,) each, by confidence from 0 to 1 and whether their label is right."""
        sure = confidence.astype(np.float64)
        at, number = np.searchsorted(self.edges, sure, side="right") - 1, len(self.edges)
        self.points += np.bincount(at, minlength=number)
        self.right += np.bincount(at[right], minlength=number)
        self.confidence += np.bincount(at, sure, minlength=number)

    @property
    def calibration_error(self) -> float | None:
        """Expected calibration error, 0 to 1; None without a point."""
        n = self.points.sum()
        return float(np.abs(self.right - self.confidence).sum() / n) if n else None

    def from_thresholds(self) -> tuple[tuple[float, float, float], ...]:
        """Threshold, coverage and precision for each bin that has points at its edge or above.

        Coverage is the share of all points that are at least so sure, precision the share of these that is right.
        """
        kept, right = (np.cumsum(counts[::-1])[::-1] for counts in (self.points, self.right))
        there = np.flatnonzero(kept)
        shares = self.edges[there], kept[there] / kept[:1], right[there] / kept[there]
        return tuple(zip(*(share.tolist() for share in shares), strict=True))


@dataclass(frozen=True, eq=False)
class Reliability:
    """Confidences of all frames held against truth.

    Attributes:
        points: All points that count.
        objects: Of these the points that prediction gives a scored class.
        by_threshold: The same as `objects` in finer bins, for precision against coverage.
    """

    points: Bins = field(default_factory=lambda: Bins(BINS))
    objects: Bins = field(default_factory=lambda: Bins(BINS))
    by_threshold: Bins = field(default_factory=lambda: Bins(THRESHOLDS))

    @checked
    def add(self, prediction: Labeling, truth: Labeling, confidence: NDArray[np.floating]) -> None:
        """Count the points of a frame that neither labeling ignores; both mapped to the same classes."""
        counted = ~(prediction.ignored | truth.ignored)
        right = prediction.classes == truth.classes
        of_objects = counted & (prediction.classes > 0)
        self.points.add(confidence[counted], right[counted])
        for bins in (self.objects, self.by_threshold):
            bins.add(confidence[of_objects], right[of_objects])
