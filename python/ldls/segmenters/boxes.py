"""Boxes as segmenters: no network needed."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from os import PathLike
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ldls.errors import MaskError
from ldls.io.masks import kitti_boxes
from ldls.masks import InstanceMasks
from ldls.segmenters.crops import Crop, assemble
from ldls.segmenters.grabcut import cut
from ldls.segmenters.segmenter import check_image, check_min_score


class BoxSegmenter:
    """Boxes of one image, drawn ahead of time; masks are the rectangles, or what GrabCut finds in them.

    Attributes:
        boxes: (n, 4) float64 left, top, right, bottom in pixels, whose centres lie at whole coordinates.
        min_score: Lowest score that is kept.
        grabcut: True if GrabCut draws the outlines.
        names: Name of each category id that masks can have.
    """

    def __init__(
        self,
        boxes: ArrayLike,
        *,
        categories: ArrayLike | None = None,
        scores: ArrayLike | None = None,
        names: Mapping[int, str] | None = None,
        grabcut: bool = False,
        min_score: float = 0.0,
    ) -> None:
        """Segmenter of the image that `boxes` were drawn in.

        Args:
            boxes: (n, 4) left, top, right, bottom in pixels; those off the image give no mask.
            categories: (n,) category ids; all 1, "object", without them.
            scores: (n,) scores from 0 to 1; all 1 without them.
            names: Name of each category id; COCO's without them.
            grabcut: Find the outlines by OpenCV's GrabCut (extra `grabcut`) in place of the rectangles.
            min_score: Lowest score that is kept, 0 to 1.

        Raises:
            MaskError: Boxes that are none, categories or scores that do not fit, or an unknown category.
            ParameterError: `min_score` is out of range.
        """
        self.boxes = np.array(boxes, np.float64)
        self.min_score = check_min_score(min_score)
        self.grabcut = grabcut
        self._rectangles = partial(
            InstanceMasks.from_boxes, self.boxes, categories=categories, scores=scores, names=names
        )
        # refuses what cannot be before an image is there
        self.names = self._rectangles((1, 1)).names
        self.boxes.flags.writeable = False

    @classmethod
    def read_kitti(
        cls,
        path: str | PathLike[str],
        *,
        names: Mapping[int, str] | None = None,
        grabcut: bool = False,
        min_score: float = 0.0,
    ) -> Self:
        """The boxes of a KITTI label_2 file, DontCare left out; categories as `kitti_boxes.KITTI_CATEGORIES` has them.

        A 16th column is the score.

        Args:
            path: Label file, or a detector's results in its layout.
            names: Names of further category ids, for classes that are neither KITTI's nor COCO's.
            grabcut: Find the outlines by OpenCV's GrabCut (extra `grabcut`) in place of the rectangles.
            min_score: Lowest score that is kept, 0 to 1.

        Raises:
            FileFormatError: A line is not KITTI's.
            MaskError: A class without category id, or a score outside 0 to 1, which KITTI allows.
            FileNotFoundError: There is no such file.
        """
        objects = kitti_boxes.read_boxes(path, names=names)
        try:
            return cls(**objects, grabcut=grabcut, min_score=min_score)
        except MaskError as error:
            raise MaskError(f"{path}: {error}") from None

    def __call__(self, image: ArrayLike) -> InstanceMasks:
        """The instances of the image (H, W, 3), uint8 RGB.

        Raises:
            ShapeError: It is not (H, W, 3).
            DtypeError: It is not uint8.
            ImportError: GrabCut is wanted and `ldls[grabcut]` not installed.
        """
        pixels = check_image(image)
        masks = self._rectangles((pixels.shape[0], pixels.shape[1])).filter(min_score=self.min_score, min_area=1)
        if not self.grabcut:
            return masks
        crops = (
            Crop(cut(pixels, *mask.bounding_box), *mask.bounding_box[:2], mask.category, mask.score) for mask in masks
        )
        return assemble(crops, masks.image_size, masks.names)

    def __repr__(self) -> str:
        return f"BoxSegmenter({len(self.boxes)} boxes, grabcut={self.grabcut}, min_score={self.min_score})"
