"""Arrays of pixels as masks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls import _ldls
from ldls.errors import MaskError, ParameterError


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
    pixels = np.asarray(mask)
    if pixels.ndim != 2:
        raise MaskError(
            f"mask {index}: expected (height, width), got shape {pixels.shape}; pass masks as (M, height, width)"
        )
    try:
        return _ldls.Rle.from_pixels(np.ascontiguousarray(_as_bool(pixels, threshold)))
    except MaskError as error:
        raise MaskError(f"mask {index}: {error}") from None


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
