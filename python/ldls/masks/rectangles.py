"""Boxes of pixels as masks."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ldls import _ldls
from ldls.errors import MaskError
from ldls.masks.image_size import checked_size


def rectangles(boxes: ArrayLike, image_size: tuple[int, int]) -> list[_ldls.Rle]:
    """The pixels whose centres lie within each box, its edges included, as far as the image goes.

    Args:
        boxes: (M, 4) left, top, right, bottom in pixels; pixel centres lie at whole numbers.
        image_size: (height, width) in pixels.

    Raises:
        MaskError: A box that is none, by its index.
        LimitError: The image is too large.
    """
    edges = np.asarray(boxes, np.float64)
    if edges.size == 0:
        edges = edges.reshape(0, 4)
    if edges.ndim != 2 or edges.shape[1] != 4:
        raise MaskError(f"boxes: expected (M, 4) left, top, right, bottom, got shape {edges.shape}")
    size = checked_size(image_size)
    _ldls.Masks(*size, [])  # refuses an image too large for masks before any is made
    return [_rectangle(i, box, size) for i, box in enumerate(edges.tolist())]


def _rectangle(index: int, box: list[float], image_size: tuple[int, int]) -> _ldls.Rle:
    left, top, right, bottom = box
    if not (-np.inf < left <= right < np.inf and -np.inf < top <= bottom < np.inf):
        raise MaskError(
            f"box {index}: {tuple(box)}, expected left <= right and top <= bottom in pixels; "
            "boxes of left, top, width, height?"
        )
    height, width = image_size
    first_column, first_row = (max(0, int(np.ceil(edge))) for edge in (left, top))
    rows = min(height, int(np.floor(bottom)) + 1) - first_row
    columns = min(width, int(np.floor(right)) + 1) - first_column
    if rows <= 0 or columns <= 0:
        return _ldls.Rle.from_runs(height, width, np.array([height * width], np.uint32))
    start = first_column * height + first_row
    if rows == height:  # whole columns are one run
        rows, columns = rows * columns, 1
    runs = np.tile(np.array([height - rows, rows]), columns)
    runs[0] = start
    rest = height * width - int(runs.sum())
    return _ldls.Rle.from_runs(height, width, np.append(runs, [rest] if rest else []).astype(np.uint32))
