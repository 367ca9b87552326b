"""Pixels and boxes as run lengths, and the size of the image they are of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.checks import as_array, as_image_size, numbers
from ldls.errors import MaskError, ParameterError, within


def encode(index: int, mask: ArrayLike, threshold: float = 0.5) -> _ldls.Rle:
    """Mask number `index` from its pixels.

    Args:
        index: Its number, for messages.
        mask: (H, W) bool, 0 and 1, 0 and 255, or probabilities.
        threshold: Least probability of a pixel of the object, above 0 and up to 1.

    Raises:
        MaskError: Another shape, or values that are no mask.
    """
    if not 0 < threshold <= 1:
        raise ParameterError(f"threshold: got {threshold!r}, expected above 0 and up to 1")
    pixels = as_array(f"mask {index}", mask, MaskError)
    if pixels.ndim != 2:
        raise MaskError(
            f"mask {index}: expected (height, width), got shape {pixels.shape}; pass masks as (M, height, width)"
        )
    with within(f"mask {index}"):
        check_pixels(*pixels.shape)
        return _ldls.Rle.from_pixels(np.ascontiguousarray(_as_bool(pixels, threshold)))


def check_pixels(height: int, width: int) -> None:
    """Refuse an image that is too large for masks, before anything of its size is made.

    Raises:
        LimitError: It has more pixels than masks may have.
    """
    _ldls.Masks(height, width, [])


def _as_bool(pixels: NDArray[Any], threshold: float) -> NDArray[np.bool_]:
    if pixels.dtype == np.bool_:
        return pixels
    if pixels.dtype.kind not in "iuf":
        raise MaskError(f"expected bool, 0 and 1, or 0 and 255, got dtype {pixels.dtype}")
    outside = ~((pixels >= 0) & (pixels <= 1))
    probabilities = pixels.dtype.kind == "f" and not outside.any()
    wrong = outside & (pixels != 255)
    if not probabilities and not wrong.any():
        wrong = ~np.isin(pixels, (0, 1, 255))  # probabilities beside 255
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise MaskError(
            f"pixel ({row}, {column}) is {pixels[row, column]}, expected bool, 0 and 1, 0 and 255, "
            "or probabilities; InstanceMasks.from_instance_image takes an image of instance numbers"
        )
    return pixels >= threshold


def rectangles(boxes: ArrayLike, size: tuple[int, int]) -> list[_ldls.Rle]:
    """The pixels whose centres lie within each box, its edges included, as far as the image goes.

    Args:
        boxes: (M, 4) left, top, right, bottom in pixels; pixel centres lie at whole numbers.
        size: (height, width) of the image in pixels.

    Raises:
        MaskError: A box that is none, by its index, or boxes that are shares of the image.
        LimitError: The image is too large.
    """
    edges = as_array("boxes", boxes, MaskError)
    if edges.size == 0:
        edges = np.zeros((0, 4))
    if edges.ndim != 2 or edges.shape[1] != 4:
        raise MaskError(f"boxes: expected (M, 4) left, top, right, bottom, got shape {edges.shape}")
    edges = numbers("boxes", edges, np.float64, ("M", 4), error=MaskError)
    # one that begins at 0, 0 may be clipped to the corner of its image
    if edges[:, :2].any() and edges.min() >= 0 and edges.max() <= 1 and (edges != np.floor(edges)).any():
        raise MaskError(
            f"boxes: all {len(edges)} lie within 0 and 1, expected pixels; are they shares of the image? Multiply them "
            "by its width and height"
        )
    checked = checked_size(size)
    check_pixels(*checked)
    return [_rectangle(i, box, checked) for i, box in enumerate(edges.tolist())]


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


def checked_size(size: object) -> tuple[int, int]:
    """`size` as two ints.

    Raises:
        MaskError: It is no pair of whole numbers from 1 to 2**31 - 1.
    """
    return as_image_size("size", size, MaskError)


def check_same_size(own: tuple[int, int], size: tuple[int, int]) -> None:
    """Refuse masks of another image than the one at hand.

    Raises:
        MaskError: The size of the masks, `own`, is not that of the image.
    """
    if own != size:
        mend = "swapped?" if own == size[::-1] else "take masks of this image, or resize them with it"
        raise MaskError(f"masks of {own} (height, width), the image is {size}; {mend}")


def uncovered(rles: Sequence[_ldls.Rle], order: Iterable[int]) -> list[_ldls.Rle]:
    """Each mask without the pixels of those whose numbers come before its own in `order`, which has all of them."""
    left = list(rles)
    taken = None
    for i in order:
        left[i] = rles[i] if taken is None else rles[i].difference(taken)
        taken = rles[i] if taken is None else rles[i].union(taken)
    return left
