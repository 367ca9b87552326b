"""Association scores of a drive: has each object one number over all sweeps?

LSTQ, S_assoc and S_cls are those of Aygün et al., 4D Panoptic LiDAR Segmentation (CVPR 2021), counted as SemanticKITTI
counts them. A tube is an object with its points of all sweeps. |s and t| are the points that a predicted tube s and a
true tube t have in common, IoU(s, t) these over the points in either, |T| the number of true tubes:

    S_assoc = 1 / |T| sum_t 1 / |t| sum_s |s and t| IoU(s, t),    LSTQ = sqrt(S_cls S_assoc)

Predicted classes do not matter to tubes: a predicted tube has all points of its number, in whatever class, scored or
not, where neither labeling ignores them. True tubes are those of the scored classes. S_cls is the mean IoU of the
scored classes. Background is not among them, as in `SemanticScores.mean_iou`; SemanticKITTI, where every point has a
class, knows none.

Matches, switches and MOTSA are those of Voigtlaender et al., MOTS (CVPR 2019). In each sweep and class an object is
matched to the predicted instance with IoU above 0.5, of which there is one at most; a switch is a match under another
number than that of the match before, however long ago. MOTSA = (TP - FP - switches) / (TP + FN).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ldls.checks import checked, whole_number
from ldls.errors import ParameterError
from ldls.evaluation.classes import CLASS_SHIFT, object_codes
from ldls.evaluation.counts import Counts
from ldls.evaluation.instance import instance_overlaps, overlaps
from ldls.evaluation.panoptic import MATCH_ABOVE
from ldls.evaluation.semantic import SemanticScores, check_vocabulary
from ldls.labeling import Labeling


@dataclass(frozen=True)
class TrackingQuality:
    """Association of the objects of one class, or of all; scores are None where there is no true object.

    Attributes:
        tubes: True objects, each with its points of all sweeps.
        association_sum: Sum of their association scores, each 0 to 1.
        counts: Instances matched, invented and missed, one by one in each sweep.
        id_switches: Matches under another number than that of the object's match before.
    """

    tubes: int = 0
    association_sum: float = 0.0
    counts: Counts = field(default_factory=Counts)
    id_switches: int = 0

    def __add__(self, other: TrackingQuality) -> TrackingQuality:
        """Both together."""
        return TrackingQuality(
            self.tubes + other.tubes,
            self.association_sum + other.association_sum,
            self.counts + other.counts,
            self.id_switches + other.id_switches,
        )

    @property
    def s_assoc(self) -> float | None:
        """Mean association score of the true objects, 0 to 1."""
        return self.association_sum / self.tubes if self.tubes else None

    @property
    def object_frames(self) -> int:
        """True objects, matched or not, one by one in each sweep."""
        return self.counts.tp + self.counts.fn

    @property
    def switches_per_100(self) -> float | None:
        """Switches in a hundred object frames."""
        return 100 * self.id_switches / self.object_frames if self.object_frames else None

    @property
    def motsa(self) -> float | None:
        """Multi-object tracking and segmentation accuracy: at most 1, and below 0 where more is wrong than is there."""
        if not self.object_frames:
            return None
        return (self.counts.tp - self.counts.fp - self.id_switches) / self.object_frames


class TrackingScores:
    """Association scores of a drive, added up sweep by sweep, and of other drives merged into it.

    Truth names an object by class and number, a prediction by its number alone; both mean the same object in every
    sweep. Points that either labeling ignores are dropped before. A true object does not count in sweeps in which it
    has fewer than `minimum_points` points (51 in SemanticKITTI), and a prediction that matches it there is neither
    right nor wrong.

    Memory grows with the number of objects, and of pairs of a true and a predicted one that share points, not with the
    number of points.

    Attributes:
        names: The scored classes.
        minimum_points: Points from which on a true object counts in a sweep.
        semantic: Points by class.
    """

    @checked
    def __init__(self, names: Sequence[str], *, minimum_points: int = 0) -> None:
        """Start without a sweep."""
        self.names = tuple(names)
        self.minimum_points = whole_number("minimum_points", minimum_points, 0)
        self.semantic = SemanticScores(self.names)
        self._matches = dict.fromkeys(self.names, TrackingQuality())
        self._last_match: dict[tuple[str, int], int] = {}
        # points of true tubes by their codes, of predicted ones by their numbers, and of both
        self._true: Counter[int] = Counter()
        self._predicted: Counter[int] = Counter()
        self._common: Counter[tuple[int, int]] = Counter()
        self._other_drives = dict.fromkeys(self.names, TrackingQuality())

    @checked
    def add(self, prediction: Labeling, truth: Labeling) -> None:
        """Count the next sweep of the drive.

        Args:
            prediction: Mapped to these classes, with the numbers of the drive, also of objects of a class that is not
                scored and so became background; 0 where the prediction itself has background.
            truth: Mapped to these classes, with the numbers of the drive.
        """
        check_vocabulary(self.names, prediction, truth)
        self.semantic.add(prediction, truth)
        self._add_tubes(prediction, truth)
        for name in self.names:
            self._matches[name] += self._matched(name, prediction, truth)

    @checked
    def merge(self, other: TrackingScores) -> None:
        """Add the drives that `other` counted; equal numbers mean other objects there."""
        if (self.names, self.minimum_points) != (other.names, other.minimum_points):
            raise ParameterError("other: has other classes or minimum points")
        self.semantic.merge(other.semantic)
        for name in self.names:
            self._other_drives[name] += other[name]

    def __getitem__(self, name: str) -> TrackingQuality:
        """Association of the objects of the class `name`."""
        return self._other_drives[name] + self._matches[name] + self._association(name)

    @property
    def total(self) -> TrackingQuality:
        """Association of the objects of all classes."""
        return sum((self[name] for name in self.names), TrackingQuality())

    @property
    def s_cls(self) -> float | None:
        """Classification score: mean IoU of the classes that truth or prediction has; None without any."""
        return self.semantic.mean_iou

    @property
    def lstq(self) -> float | None:
        """LiDAR segmentation and tracking quality, sqrt(`s_cls` x `total.s_assoc`); None without a true object."""
        s_assoc, s_cls = self.total.s_assoc, self.s_cls
        return None if s_assoc is None or s_cls is None else math.sqrt(s_cls * s_assoc)

    def _add_tubes(self, prediction: Labeling, truth: Labeling) -> None:
        rows = np.flatnonzero(~(truth.ignored | prediction.ignored))
        instances = prediction.instances[rows]
        numbers = np.where(instances > 0, instances, -1)
        overlap = overlaps(numbers, object_codes(truth.classes[rows], truth.instances[rows]))
        counts = overlap.truth_points >= self.minimum_points
        codes, numbers = overlap.truth_ids.tolist(), overlap.prediction_ids.tolist()
        self._predicted.update(dict(zip(numbers, overlap.prediction_points.tolist(), strict=True)))
        for t in np.flatnonzero(counts).tolist():
            self._true[codes[t]] += int(overlap.truth_points[t])
            for p in np.flatnonzero(overlap.common[t]).tolist():
                self._common[codes[t], numbers[p]] += int(overlap.common[t, p])

    def _matched(self, name: str, prediction: Labeling, truth: Labeling) -> TrackingQuality:
        """Matches of a class in one sweep."""
        overlap = instance_overlaps(prediction, truth, name)
        match = overlap.iou > MATCH_ABOVE
        counts = overlap.truth_points >= self.minimum_points
        switches = 0
        rows, columns = np.nonzero(match & counts[:, None])
        for t, p in zip(overlap.truth_ids[rows].tolist(), overlap.prediction_ids[columns].tolist(), strict=True):
            switches += self._last_match.get((name, t), p) != p
            self._last_match[name, t] = p
        found, invented = len(rows), int((~match.any(axis=0)).sum())
        return TrackingQuality(counts=Counts(found, invented, int(counts.sum()) - found), id_switches=switches)

    def _association(self, name: str) -> TrackingQuality:
        """Tubes of a class in the drive at hand."""
        k = self.names.index(name) + 1
        total = sum(
            both / self._true[code] * both / (self._true[code] + self._predicted[number] - both)
            for (code, number), both in self._common.items()
            if code >> CLASS_SHIFT == k
        )
        return TrackingQuality(sum(code >> CLASS_SHIFT == k for code in self._true), float(total))
