"""Which instances of two labelings overlap, and by how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Overlaps of T true with P predicted segments.

    Attributes:
        truth_ids: (T,) numbers of the true segments, ascending.
        prediction_ids: (P,) numbers of the predicted segments, ascending.
        truth_points: (T,) int64: points of each true segment.
        prediction_points: (P,) int64: points of each predicted segment.
        iou: (T, P) float64: points in both over points in either.
    """

    truth_ids: NDArray[np.int32]
    prediction_ids: NDArray[np.int32]
    truth_points: NDArray[np.int64]
    prediction_points: NDArray[np.int64]
    iou: NDArray[np.float64]


def overlaps(prediction: NDArray[np.int32], truth: NDArray[np.int32]) -> Overlaps:
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
    both = both[true][:, predicted]
    iou = both / (truth_points[:, None] + prediction_points[None, :] - both)
    return Overlaps(truth_ids[true], prediction_ids[predicted], truth_points, prediction_points, iou)
