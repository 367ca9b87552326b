"""Images fitted into a network's input: scaled as a whole, centred, the rest grey."""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from ldls.masks.resampling import F32, bilinear_weights, resize

GREY = 114
FARTHEST = 1e6
"""Pixels at which boxes are cut, before anything overflows."""


@dataclass(frozen=True)
class Letterbox:
    """Place of an image of `image_size` in an input of `input_size`, as Ultralytics defines it.

    Attributes:
        image_size: (height, width) of the image in pixels.
        input_size: (height, width) of the network's input.
        scaled_size: (height, width) of the image within the input.
        top: Rows of grey above it.
        left: Columns of grey before it.
    """

    image_size: tuple[int, int]
    input_size: tuple[int, int]
    scaled_size: tuple[int, int]
    top: int
    left: int

    @classmethod
    def fit(cls, image_size: tuple[int, int], input_size: tuple[int, int], *, stride: int | None = None) -> Letterbox:
        """The largest fit; with a `stride`, the input shrinks to the least multiple of it that holds the image."""
        height, width = _fitted(image_size, input_size)
        spare_rows, spare_columns = input_size[0] - height, input_size[1] - width
        if stride is not None:
            spare_rows, spare_columns = spare_rows % stride, spare_columns % stride
        return cls(
            image_size=image_size,
            input_size=(height + spare_rows, width + spare_columns),
            scaled_size=(height, width),
            top=_before(spare_rows),
            left=_before(spare_columns),
        )

    def fill(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The input (h, w, 3) that shows `image` (H, W, 3)."""
        height, width = self.scaled_size
        filled = np.full((*self.input_size, 3), GREY, np.uint8)
        filled[self.top : self.top + height, self.left : self.left + width] = resize(image, height, width)
        return filled

    def boxes_in_image(self, boxes: F32) -> F32:
        """(N, 4) left, top, right, bottom in pixels of the image, clipped to it, of boxes in the input."""
        height, width = self.image_size
        scale = np.array([self.scaled_size[1] / width, self.scaled_size[0] / height], np.float32)
        offset = np.array([self.left, self.top], np.float32)
        corners = (np.clip(boxes, -FARTHEST, FARTHEST).reshape(-1, 2, 2) - offset) / scale
        clipped: F32 = np.clip(corners, 0, np.array([width, height], np.float32)).reshape(-1, 4)
        return clipped

    def upsampling(self, grid_size: tuple[int, int]) -> tuple[F32, F32]:
        """Weights (H, h) of rows and (W, w) of columns: `rows @ grid @ columns.T` is a grid over the input as an image.

        The grid is first made so much finer, at most 4 times, that the grey ends between its cells; then the grey is
        cut off and the rest resampled (`process_mask_native` with `scale_masks` of Ultralytics 8.4).
        """
        image, grid = self.image_size, grid_size
        # the grey as Ultralytics reckons it for inputs that are 4 times as fine as the grid
        spare = [4 * cells - side for cells, side in zip(grid, _fitted(image, (4 * grid[0], 4 * grid[1])), strict=True)]
        finer = 4 // gcd(4, *spare, *(s // 2 for s in spare))
        fine = (finer * grid[0], finer * grid[1])
        inner = _fitted(image, fine)
        rows, columns = (_upsampling(*axis) for axis in zip(grid, fine, inner, image, strict=True))
        return rows, columns


def _fitted(image_size: tuple[int, int], frame: tuple[int, int]) -> tuple[int, int]:
    gain = min(frame[0] / image_size[0], frame[1] / image_size[1])
    return max(round(image_size[0] * gain), 1), max(round(image_size[1] * gain), 1)


def _upsampling(cells: int, fine: int, inner: int, pixels: int) -> F32:
    before = _before(fine - inner)
    weights: F32 = bilinear_weights(inner, pixels) @ bilinear_weights(cells, fine)[before : before + inner]
    return weights


def _before(spare: int) -> int:
    return max(round(spare / 2 - 0.1), 0)
