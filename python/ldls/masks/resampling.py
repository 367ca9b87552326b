"""Bilinear resampling as networks use it: pixel centres at half coordinates, the edge repeated beyond it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
ONE = 2048
"""Sum of weights of whole numbers."""


def bilinear_taps(
    source: int, target: int, window: slice = slice(None)
) -> tuple[NDArray[np.int64], NDArray[np.int64], F32]:
    """Place each of `target` cells among `source` cells: the cell before, the one after, the share of the latter.

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


def upsample(grid: F32, size: tuple[int, int], window: tuple[slice, slice]) -> F32:
    """A grid (h, w) resampled to the (height, width) of `size`; only rows and columns of `window` are made."""
    above, below, down = bilinear_taps(grid.shape[0], size[0], window[0])
    left, right, across = bilinear_taps(grid.shape[1], size[1], window[1])
    columns = grid[:, left] * (1 - across) + grid[:, right] * across
    return np.asarray(columns[above] * (1 - down)[:, None] + columns[below] * down[:, None], np.float32)


def resize(image: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    """An image (H, W, C) resampled to (height, width, C), as OpenCV's `INTER_LINEAR` does it for 8 bits.

    OpenCV reckons in whole numbers: weights are multiples of 1 / 2048, sums lose 4 bits, products 16, and the last 2
    are rounded away. OpenCV 5.0 on x86 gives the same bits; other builds may differ by one level.
    """
    if image.shape[:2] == (height, width):
        return image
    left, right, across = _fixed_point_taps(image.shape[1], width)
    top, bottom, down = _fixed_point_taps(image.shape[0], height)
    # beyond the first and last column one pixel has all the weight; of rows both keep theirs
    across[:, left == right] = [[ONE], [0]]
    levels = image.astype(np.int32)
    rows = (levels[:, left] * across[0, :, None] + levels[:, right] * across[1, :, None]) >> 4
    above, below = (rows[side] * weight[:, None, None] >> 16 for side, weight in ((top, down[0]), (bottom, down[1])))
    resized: NDArray[np.uint8] = ((above + below + 2) >> 2).astype(np.uint8)
    return resized


def _fixed_point_taps(source: int, target: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """The cells before and after each of `target` cells, within `source`, and their weights (2, target)."""
    place = ((np.arange(target) + 0.5) * (source / target) - 0.5).astype(np.float32)
    before = np.floor(place)
    share = place - before
    weights = np.rint(np.stack([1 - share, share]) * np.float32(ONE)).astype(np.int32)
    first, second = (np.clip(cell, 0, source - 1).astype(np.int64) for cell in (before, before + 1))
    return first, second, weights
