"""Masks that Mask R-CNN draws on a small grid, pasted into its boxes.

Only the part of a box that lies within the image is computed.
"""

from __future__ import annotations

import numpy as np

from ldls.masks.resampling import F32, bilinear_weights

MAX_SIDE = 1 << 20
"""Longer boxes, in pixels, are cut; nothing sound draws them."""


def padded_paste(grid: F32, box: F32, image_size: tuple[int, int]) -> tuple[F32, int, int]:
    """Probabilities within the image, and the row and column of the first, as torchvision pastes them.

    `torchvision.models.detection.roi_heads.paste_masks_in_image`: a cell of zeros around the grid, the box enlarged
    with it and cut to whole pixels, both ends within.

    Args:
        grid: (S, S) probabilities.
        box: (4,) left, top, right, bottom in pixels.
        image_size: (height, width) in pixels.
    """
    box = np.clip(box, -MAX_SIDE, MAX_SIDE)
    scale = (grid.shape[0] + 2) / grid.shape[0]
    middle, half = (box[2:] + box[:2]) * np.float32(0.5), (box[2:] - box[:2]) * np.float32(0.5 * scale)
    enlarged = np.concatenate([middle - half, middle + half]).astype(np.float32)
    return paste(np.pad(grid, 1), *_whole(enlarged), image_size)


def plain_paste(grid: F32, box: F32, image_size: tuple[int, int]) -> tuple[F32, int, int]:
    """Probabilities within the image, and the row and column of the first, as the ONNX Model Zoo pastes them.

    The box is cut to whole pixels, both ends within, and the grid stretched over it; arguments as of `padded_paste`.
    """
    return paste(grid, *_whole(box), image_size)


def paste(grid: F32, left: int, top: int, right: int, bottom: int, image_size: tuple[int, int]) -> tuple[F32, int, int]:
    """`grid` stretched over the pixels from (left, top) to (right, bottom), both within, where the image has them."""
    rows, first_row = _axis(grid.shape[0], top, bottom, image_size[0])
    columns, first_column = _axis(grid.shape[1], left, right, image_size[1])
    values = np.asarray(rows @ grid @ columns.T, np.float32)
    return values, first_row, first_column


def _axis(cells: int, first: int, last: int, length: int) -> tuple[F32, int]:
    """Weights of the cells for each pixel from `first` to `last` that the image has, and the first such pixel."""
    start, stop = max(first, 0), min(last + 1, length)
    if stop <= start:
        return np.zeros((0, cells), np.float32), 0
    return bilinear_weights(cells, last - first + 1, slice(start - first, stop - first)), start


def _whole(box: F32) -> tuple[int, int, int, int]:
    left, top, right, bottom = (int(edge) for edge in np.clip(box, -MAX_SIDE, MAX_SIDE))
    return left, top, right, bottom
