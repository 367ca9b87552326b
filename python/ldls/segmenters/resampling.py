"""Bilinear resampling as networks use it: pixel centres at half coordinates, the edge repeated beyond it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]


def bilinear_taps(
    source: int, target: int, window: slice = slice(None)
) -> tuple[NDArray[np.int64], NDArray[np.int64], F32]:
    """Where each of `target` cells falls among `source` cells: the cell before, the one after, the share of the latter.

    This is what `align_corners=False` means in PyTorch and `INTER_LINEAR` in OpenCV, without a filter against
    aliasing. Only the cells of `window` are reckoned.
    """
    cells = np.arange(*window.indices(target))
    place = np.clip((cells + 0.5) * (source / target) - 0.5, 0, source - 1)
    before = place.astype(np.int64)
    return before, np.minimum(before + 1, source - 1), (place - before).astype(np.float32)


def bilinear_weights(source: int, target: int, window: slice = slice(None)) -> F32:
    """(target, source) weights: `weights @ values` are `values` (source, ...) resampled to `target` rows.

    Only the rows of `window` are made.
    """
    before, after, share = bilinear_taps(source, target, window)
    weights = np.zeros((len(share), source), np.float32)
    rows = np.arange(len(share))
    weights[rows, before] = 1 - share
    weights[rows, after] += share
    return weights


def resize(image: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """An image (H, W, C) resampled to (height, width, C), rounded; within one level of `cv2.resize`."""
    if image.shape[:2] == (height, width):
        return image
    left, right, across = bilinear_taps(image.shape[1], width)
    top, bottom, down = bilinear_taps(image.shape[0], height)
    rows = _blend(image[top], image[bottom], down[:, None, None])
    columns = _blend(rows[:, left], rows[:, right], across[None, :, None])
    return np.round(columns).astype(np.uint8)


def _blend(one: NDArray[np.generic], other: NDArray[np.generic], share: F32) -> F32:
    first: F32 = one.astype(np.float32)
    first += (other.astype(np.float32) - first) * share
    return first
