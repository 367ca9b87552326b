"""The interface of a segmenter, and checks of what it is given."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.errors import DtypeError, ParameterError, ShapeError
from ldls.masks import InstanceMasks


class Segmenter(Protocol):
    """Turns an image into instance masks."""

    def __call__(self, image: NDArray[np.uint8]) -> InstanceMasks:
        """The instances of an image (H, W, 3), uint8 RGB."""
        ...


def check_min_score(min_score: float) -> float:
    """`min_score`, the lowest score that is kept.

    Raises:
        ParameterError: It is not from 0 to 1.
    """
    if not 0 <= min_score <= 1:
        raise ParameterError(f"min_score: got {min_score!r}, expected 0 to 1")
    return min_score


def check_image(image: ArrayLike) -> NDArray[np.uint8]:
    """`image` as a contiguous array (H, W, 3), uint8 RGB.

    Raises:
        ShapeError: It is not (H, W, 3), or has no pixels.
        DtypeError: It is not uint8.
    """
    pixels = np.asarray(image)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        raise ShapeError(f"image: expected (height, width, 3), got {pixels.shape}{_hint(pixels.shape)}")
    if pixels.dtype != np.uint8:
        raise DtypeError(
            f"image: expected uint8 from 0 to 255, got {pixels.dtype}; cast, after a factor of 255 if it ends at 1"
        )
    return np.ascontiguousarray(pixels)


def _hint(shape: tuple[int, ...]) -> str:
    if len(shape) == 2:
        return "; repeat a grey image: np.stack([image] * 3, axis=-1)"
    if len(shape) == 3 and shape[2] == 4:
        return "; leave the alpha channel out: image[:, :, :3]"
    if len(shape) == 3 and shape[0] == 3:
        return "; channels come last: image.transpose(1, 2, 0)"
    return ""
