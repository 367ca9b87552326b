"""Precision, recall and IoU of classes, counted over all points of all frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ldls.checks import checked
from ldls.errors import ParameterError
from ldls.evaluation.counts import Counts, mean
from ldls.labeling import BACKGROUND, Labeling


class SemanticScores:
    """Confusion of classes, added up frame by frame.

    Attributes:
        names: The scored classes.
        confusion: (K + 1, K + 1) int64: points by true class (row) and predicted class (column), background first.
    """

    @checked
    def __init__(self, names: Sequence[str]) -> None:
        """Start without a point."""
        self.names = tuple(names)
        self.confusion: NDArray[np.int64] = np.zeros((len(self.names) + 1,) * 2, np.int64)

    @checked
    def add(self, prediction: Labeling, truth: Labeling) -> None:
        """Count the points of a frame that neither labeling ignores; both mapped to these classes."""
        check_vocabulary(self.names, prediction, truth)
        counted = ~(prediction.ignored | truth.ignored)
        side = len(self.names) + 1
        # one number a cell of the table; int64 by the shape's own size, for classes are int32
        cells = truth.classes[counted].astype(np.int64) * side + prediction.classes[counted]
        self.confusion += np.bincount(cells, minlength=side * side).reshape(side, side)

    @checked
    def merge(self, other: SemanticScores) -> None:
        """Add the points that `other` counted."""
        if other.names != self.names:
            raise ParameterError(f"other: has classes {other.names}, expected {self.names}")
        self.confusion += other.confusion

    def __getitem__(self, name: str) -> Counts:
        """Points of the class `name` found, invented and missed."""
        if name not in self.names:
            raise KeyError(name)
        k = self.names.index(name) + 1
        hits = int(self.confusion[k, k])
        return Counts(hits, int(self.confusion[:, k].sum()) - hits, int(self.confusion[k].sum()) - hits)

    @property
    def mean_iou(self) -> float | None:
        """Mean IoU of the classes that truth or prediction has; None without any."""
        return mean([self[name].iou for name in self.names])


def check_vocabulary(names: tuple[str, ...], *labelings: Labeling) -> None:
    """Refuse labelings that were not mapped to the classes `names`."""
    for labeling in labelings:
        if labeling.names != (BACKGROUND, *names):
            raise ParameterError(f"labeling has classes {labeling.names}, expected {names}; map it to them first")
