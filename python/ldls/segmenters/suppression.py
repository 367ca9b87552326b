"""Non-maximum suppression, class by class."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def suppress(
    boxes: NDArray[np.float32],
    scores: NDArray[np.float32],
    classes: NDArray[np.int64],
    *,
    max_iou: float,
    max_kept: int,
) -> NDArray[np.int64]:
    """Indices of the boxes that no better box of their class overlaps by more than `max_iou`, best first.

    Args:
        boxes: (N, 4) left, top, right, bottom.
        scores: (N,) scores; of equal ones the first is the better.
        classes: (N,) classes.
        max_iou: Largest overlap, as intersection over union, of two boxes that are both kept.
        max_kept: How many are kept at most.
    """
    left, top, right, bottom = boxes.T.astype(np.float64)  # areas of huge boxes overflow in single precision
    areas = (right - left) * (bottom - top)
    waiting = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while waiting.size and len(kept) < max_kept:
        best, waiting = waiting[0], waiting[1:]
        kept.append(int(best))
        wide = np.minimum(right[best], right[waiting]) - np.maximum(left[best], left[waiting])
        tall = np.minimum(bottom[best], bottom[waiting]) - np.maximum(top[best], top[waiting])
        shared = np.maximum(wide, 0) * np.maximum(tall, 0)
        # no division: boxes without area overlap nothing
        hidden = (shared > max_iou * (areas[best] + areas[waiting] - shared)) & (classes[waiting] == classes[best])
        waiting = waiting[~hidden]
    return np.array(kept, np.int64)
