"""Boxes as segmenters: no network needed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.categories import COCO_NAMES, category_ids
from ldls.errors import MaskError, NonFiniteError, ShapeError
from ldls.io.kitti_objects import KittiObject, read_kitti_objects
from ldls.masks import InstanceMasks
from ldls.segmenters.classes import Classes
from ldls.segmenters.crops import Crop, assemble
from ldls.segmenters.grabcut import cut
from ldls.segmenters.image import check_image
from ldls.segmenters.segmenter import check_min_score

KITTI_IDS = {
    "Car": 3,
    "Pedestrian": 1,
    "Person_sitting": 1,
    "Truck": 8,
    "Tram": 7,
    "Van": 101,
    "Cyclist": 102,
    "Misc": 103,
}
"""Category ids of KITTI's classes; those over 100 are not COCO's, and keep KITTI's names."""
FIRST_OTHER = 4
"""Where classes that are neither KITTI's nor COCO's begin to count, so that their ids follow 103."""


class BoxSegmenter:
    """Boxes of one image, drawn ahead of time; masks are the rectangles, or what GrabCut finds in them.

    Attributes:
        boxes: (n, 4) float64 left, top, right, bottom in pixels, whose centres lie at whole coordinates.
        min_score: Lowest score that is kept.
        grabcut: Whether GrabCut draws the outlines.
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
            boxes: (n, 4) left, top, right, bottom in pixels; those without area or off the image give no mask.
            categories: (n,) category ids; all 1, "object", without them.
            scores: (n,) scores from 0 to 1; all 1 without them.
            names: Name of each category id; COCO's without them.
            grabcut: Find the outlines by OpenCV's GrabCut (extra `grabcut`) in place of the rectangles.
            min_score: Lowest score that is kept, 0 to 1.

        Raises:
            ShapeError: `boxes` are not (n, 4).
            NonFiniteError: A box has NaN or infinity.
            MaskError: Categories or scores that do not fit, or an unknown category.
            ParameterError: `min_score` is out of range.
        """
        self.boxes = _check_boxes(boxes)
        if categories is None:
            categories, names = np.ones(len(self.boxes), np.int32), names or {1: "object"}
        self._names = dict(COCO_NAMES if names is None else names)
        self._categories = _per_box("categories", categories, len(self.boxes), np.int32)
        self._scores = _per_box("scores", 1.0 if scores is None else scores, len(self.boxes), np.float64)
        for i, category in enumerate(self._categories.tolist()):
            if category not in self._names:
                raise MaskError(f"box {i}: category {category} is unknown; pass names={{{category}: '...'}}")
        for i, score in enumerate(self._scores.tolist()):
            if not 0 <= score <= 1:
                raise MaskError(f"box {i}: score is {score}, expected 0 to 1")
        self.min_score = check_min_score(min_score)
        self.grabcut = grabcut

    @classmethod
    def from_kitti(cls, path: str | PathLike[str], *, grabcut: bool = False, min_score: float = 0.0) -> Self:
        """The boxes of a KITTI label_2 file, DontCare left out; categories as `KITTI_IDS` has them.

        Other classes have COCO's id where COCO knows the name, otherwise ids from 104 on in their order in the file.
        A 16th column is the score.

        Raises:
            FileFormatError: A line is not KITTI's.
            MaskError: A score outside 0 to 1, which KITTI allows.
            FileNotFoundError: There is no such file.
        """
        objects = [one for one in read_kitti_objects(path) if not one.is_region]
        for number, one in enumerate(objects, start=1):
            _check_kitti_score(f"{path}, object {number}", one)
        ids = _kitti_ids([one.type for one in objects])
        return cls(
            np.array([one.bbox for one in objects]).reshape(-1, 4),
            categories=[ids[one.type] for one in objects],
            scores=[1.0 if one.score is None else one.score for one in objects],
            names=COCO_NAMES | {i: name for name, i in ids.items() if i not in COCO_NAMES},
            grabcut=grabcut,
            min_score=min_score,
        )

    def __call__(self, image: ArrayLike) -> InstanceMasks:
        """The instances of the image (H, W, 3), uint8 RGB.

        Raises:
            ShapeError: It is not (H, W, 3).
            DtypeError: It is not uint8.
            ImportError: GrabCut is wanted and `ldls[grabcut]` not installed.
        """
        pixels = check_image(image)
        classes = Classes({}, self._names)
        return assemble(self._crops(pixels), (pixels.shape[0], pixels.shape[1]), classes)

    def __repr__(self) -> str:
        return f"BoxSegmenter({len(self.boxes)} boxes, grabcut={self.grabcut}, min_score={self.min_score})"

    def _crops(self, image: NDArray[np.uint8]) -> Iterator[Crop]:
        for box, category, score in zip(self.boxes, self._categories.tolist(), self._scores.tolist(), strict=True):
            left, top, right, bottom = box.tolist()
            rows, columns = _within(top, bottom, image.shape[0]), _within(left, right, image.shape[1])
            if score >= self.min_score and rows and columns:
                yield Crop(self._pixels(image, rows, columns), rows.start, columns.start, category, score)

    def _pixels(self, image: NDArray[np.uint8], rows: range, columns: range) -> NDArray[np.bool_]:
        if self.grabcut:
            return cut(image, rows.start, columns.start, len(rows), len(columns))
        return np.ones((len(rows), len(columns)), np.bool_)


def _within(first: float, last: float, length: int) -> range:
    """Pixels whose centres lie from `first` to `last`, of those from 0 to `length` - 1."""
    start, stop = max(first, 0), min(last, length - 1)
    return range(math.ceil(start), math.floor(stop) + 1) if first < last else range(0)


def _kitti_ids(types: Sequence[str]) -> dict[str, int]:
    others = [name for name in dict.fromkeys(types) if name not in KITTI_IDS]
    ids = category_ids(dict(enumerate(others, start=FIRST_OTHER)))
    return KITTI_IDS | {name: ids[i] for i, name in enumerate(others, start=FIRST_OTHER)}


def _check_kitti_score(place: str, one: KittiObject) -> None:
    if one.score is not None and not 0 <= one.score <= 1:
        raise MaskError(
            f"{place}: score is {one.score}, expected 0 to 1; KITTI allows any number as a score, ldls does not: "
            "map the scores of the detector to 0 to 1 first"
        )


def _check_boxes(boxes: ArrayLike) -> NDArray[np.float64]:
    array = np.array(boxes, np.float64)
    if array.size == 0:
        array = array.reshape(0, 4)
    if array.ndim != 2 or array.shape[1] != 4:
        raise ShapeError(f"boxes: expected (n, 4) left, top, right, bottom, got {array.shape}")
    wrong = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if wrong.size:
        raise NonFiniteError(f"boxes: box {wrong[0]} is {array[wrong[0]].tolist()}, expected finite pixels")
    array.flags.writeable = False
    return array


def _per_box(name: str, values: ArrayLike, count: int, dtype: type) -> NDArray[np.generic]:
    array = np.asarray(values)
    array = np.full(count, array) if array.ndim == 0 else array
    if array.shape != (count,):
        raise MaskError(f"{name}: expected one for each of {count} boxes, got shape {array.shape}")
    return array.astype(dtype)
