"""True and false positives and false negatives, and the scores that follow."""

from __future__ import annotations

from dataclasses import dataclass

from ldls.checks import checked


@checked
@dataclass(frozen=True)
class Counts:
    """Numbers of things (points, or instances) found, invented and missed.

    Scores are None where there is nothing to score: neither truth nor prediction has such a thing. Otherwise a score
    whose denominator is 0 is 0: the precision of what was never predicted, the recall of what was only invented.

    Attributes:
        tp: True positives.
        fp: False positives.
        fn: False negatives.
    """

    tp: int = 0
    fp: int = 0
    fn: int = 0

    def __add__(self, other: Counts) -> Counts:
        """Both counts together."""
        return Counts(self.tp + other.tp, self.fp + other.fp, self.fn + other.fn)

    @property
    def precision(self) -> float | None:
        """TP / (TP + FP)."""
        return self._score(self.tp + self.fp)

    @property
    def recall(self) -> float | None:
        """TP / (TP + FN)."""
        return self._score(self.tp + self.fn)

    @property
    def iou(self) -> float | None:
        """TP / (TP + FP + FN), the intersection over the union."""
        return self._score(self.tp + self.fp + self.fn)

    @property
    def f1(self) -> float | None:
        """TP / (TP + FP / 2 + FN / 2), which panoptic quality calls recognition quality."""
        return self._score(self.tp + self.fp / 2 + self.fn / 2)

    def _score(self, denominator: float) -> float | None:
        if self.tp + self.fp + self.fn == 0:
            return None
        return self.tp / denominator if denominator else 0.0


def mean(scores: list[float | None]) -> float | None:
    """Mean of the scores that are there; None without any."""
    there = [score for score in scores if score is not None]
    return sum(there) / len(there) if there else None
