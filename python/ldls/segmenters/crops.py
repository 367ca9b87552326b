"""Instances as small masks with a place, and the instance masks they make."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls
from ldls.categories import is_object
from ldls.masks import InstanceMasks


@dataclass(frozen=True, eq=False)
class Crop:
    """One instance: what it covers of a rectangle of the image, and nothing outside.

    Attributes:
        pixels: (h, w) bool; the rectangle lies within the image.
        top: Row of its first pixel.
        left: Column of its first pixel.
        category: Category id.
        score: 0 to 1.
    """

    pixels: NDArray[np.bool_]
    top: int
    left: int
    category: int
    score: float


def assemble(crops: Iterable[Crop], image_size: tuple[int, int], names: Mapping[int, str]) -> InstanceMasks:
    """Masks of an image of (height, width) pixels; instances without a pixel, and of no object, are left out."""
    canvas = np.zeros(image_size, np.bool_)
    rles, categories, scores = [], [], []
    for crop in crops:  # one at a time: a crop may be as large as the image
        if crop.pixels.any() and is_object(names[crop.category]):
            rles.append(_encode(crop, canvas))
            categories.append(crop.category)
            scores.append(crop.score)
    return InstanceMasks(
        rles,
        image_size,
        categories=np.array(categories, np.int32),
        scores=np.array(scores, np.float32),
        names=names,
    )


def _encode(crop: Crop, canvas: NDArray[np.bool_]) -> _ldls.Rle:
    """Run lengths by way of one canvas for all, which is left clean."""
    height, width = crop.pixels.shape
    window = canvas[crop.top : crop.top + height, crop.left : crop.left + width]
    window[...] = crop.pixels
    rle = _ldls.Rle.from_pixels(canvas)
    window[...] = False
    return rle
