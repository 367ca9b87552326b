"""One instance mask of an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls


@dataclass(frozen=True)
class InstanceMask:
    """One instance of an image.

    Attributes:
        category: Category id.
        name: Category name.
        score: Score of the 2D segmenter, 0 to 1.
        rle: Its pixels as column-major run lengths.
    """

    category: int
    name: str
    score: float
    rle: _ldls.Rle

    @property
    def area(self) -> int:
        """Number of pixels."""
        return self.rle.area

    @property
    def bounding_box(self) -> tuple[int, int, int, int]:
        """(top, left, height, width) in pixels of the smallest box around it; zeros if it is empty."""
        return self.rle.bounding_box

    def crop(self) -> NDArray[np.bool_]:
        """(height, width) pixels within the bounding box."""
        return self.rle.crop(*self.bounding_box)

    def to_array(self) -> NDArray[np.bool_]:
        """(H, W) pixels of the whole image."""
        return self.rle.crop(0, 0, self.rle.height, self.rle.width)
