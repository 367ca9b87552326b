"""Panoptic quality, as SemanticKITTI takes it from Kirillov et al. (CVPR 2019).

PQ = SQ x RQ of each class: segments match where their IoU exceeds 0.5, which can happen but once; SQ is the mean IoU of
the matches and RQ = TP / (TP + FP / 2 + FN / 2). Points without truth are dropped before. As in SemanticKITTI's
definition, all points of a class without an instance number are one segment, and unmatched segments of fewer than
`minimum_points` points (50 there) are neither missed nor invented.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ldls.checks import checked, whole_number
from ldls.evaluation.counts import Counts, mean
from ldls.evaluation.instance import overlaps
from ldls.evaluation.semantic import check_vocabulary
from ldls.labeling import Labeling

MATCH_ABOVE = 0.5


@dataclass(frozen=True)
class PanopticQuality:
    """Quality of the segments of one class; scores are None where there is no segment at all.

    Attributes:
        counts: Segments found, invented and missed.
        iou_sum: Sum of the IoUs of the segments found.
    """

    counts: Counts = field(default_factory=Counts)
    iou_sum: float = 0.0

    @property
    def pq(self) -> float | None:
        """Panoptic quality: `sq` x `rq`."""
        return None if self.sq is None or self.rq is None else self.sq * self.rq

    @property
    def sq(self) -> float | None:
        """Segmentation quality: mean IoU of the segments found; 0 if none was."""
        if self.counts == Counts():
            return None
        return self.iou_sum / self.counts.tp if self.counts.tp else 0.0

    @property
    def rq(self) -> float | None:
        """Recognition quality: F1 of the segments."""
        return self.counts.f1


class PanopticScores:
    """Panoptic quality of each class, added up frame by frame.

    Attributes:
        names: The scored classes.
        minimum_points: Points from which on an unmatched segment counts.
    """

    @checked
    def __init__(self, names: Sequence[str], *, minimum_points: int = 0) -> None:
        """Start without a segment."""
        self.names = tuple(names)
        self.minimum_points = whole_number("minimum_points", minimum_points, 0)
        self._qualities = dict.fromkeys(self.names, PanopticQuality())

    @checked
    def add(self, prediction: Labeling, truth: Labeling) -> None:
        """Count the segments of a frame; both labelings mapped to these classes."""
        check_vocabulary(self.names, prediction, truth)
        for k, name in enumerate(self.names, start=1):
            before, now = self._qualities[name], _quality(prediction, truth, k, self.minimum_points)
            self._qualities[name] = PanopticQuality(before.counts + now.counts, before.iou_sum + now.iou_sum)

    def __getitem__(self, name: str) -> PanopticQuality:
        """Quality of the class `name`."""
        return self._qualities[name]

    @property
    def mean_pq(self) -> float | None:
        """Mean PQ of the classes that have segments; None without any."""
        return mean([self[name].pq for name in self.names])


def _quality(prediction: Labeling, truth: Labeling, k: int, minimum_points: int) -> PanopticQuality:
    theirs, ours = truth.classes == k, prediction.classes == k
    rows = np.flatnonzero((theirs | ours) & ~(truth.ignored | prediction.ignored))
    overlap = overlaps(
        np.where(ours[rows], prediction.instances[rows], np.int32(-1)),
        np.where(theirs[rows], truth.instances[rows], np.int32(-1)),
    )
    match = overlap.iou > MATCH_ABOVE
    missed = ~match.any(axis=1) & (overlap.truth_points >= minimum_points)
    invented = ~match.any(axis=0) & (overlap.prediction_points >= minimum_points)
    counts = Counts(int(match.sum()), int(invented.sum()), int(missed.sum()))
    return PanopticQuality(counts, float(overlap.iou[match].sum()))
