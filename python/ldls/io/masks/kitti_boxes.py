"""The 2D boxes of KITTI label_2 files as rectangular masks."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from ldls.categories import COCO_NAMES, class_id, folded
from ldls.errors import MaskError, within
from ldls.io.labels.kitti_objects import KittiObject, read_kitti_objects
from ldls.masks import InstanceMasks

KITTI_CATEGORIES: dict[str, int] = {
    "Pedestrian": 1, "Person_sitting": 1, "Car": 3, "Tram": 7, "Truck": 8, "Van": 101, "Cyclist": 102, "Misc": 103,
}  # fmt: skip
"""Category id of each of KITTI's classes: COCO's where COCO has it."""

KITTI_NAMES: dict[int, str] = COCO_NAMES | {101: "Van", 102: "Cyclist", 103: "Misc"}
"""Name of each category id: COCO's, and KITTI's for the rest."""


def read_boxes(path: str | PathLike[str], *, names: Mapping[int, str] | None = None) -> dict[str, Any]:
    """Arguments of `InstanceMasks.from_boxes` but for the size: boxes, categories, scores and names of a label_2 file.

    DontCare rows are left out, objects without a score get 1.

    Args:
        path: Label file, or a detector's results in its layout.
        names: Names of further category ids, for classes that are not KITTI's, or for KITTI's in the place of its own;
            0 is passed over.

    Raises:
        MaskError: A class without category id, or a score outside 0 to 1.
        FileFormatError: The file is broken; see `read_kitti_objects`.
    """
    objects = [each for each in read_kitti_objects(path) if not each.is_region]
    given = {category: name for category, name in (names or {}).items() if category != 0}
    known = dict(given)
    of_kitti = {name: class_id(category, KITTI_NAMES[category], known) for name, category in KITTI_CATEGORIES.items()}
    all_names = COCO_NAMES | known
    ids = (
        _ids_by_type(all_names) | {folded(name): category for name, category in of_kitti.items()} | _ids_by_type(given)
    )
    with within(path):
        return {
            "boxes": [each.bbox for each in objects],
            "categories": [_category(i, each, ids) for i, each in enumerate(objects)],
            "scores": [_score(i, each) for i, each in enumerate(objects)],
            "names": all_names,
        }


def _ids_by_type(names: Mapping[int, str]) -> dict[str, int]:
    """Category id of each class, by its folded name."""
    return {folded(name): category for category, name in names.items()}


def read(path: str | PathLike[str], *, image_size: tuple[int, int], names: Mapping[int, str] | None) -> InstanceMasks:
    """One rectangle for each object of a label_2 file, as `read_boxes` finds them.

    Args:
        path: Label file, or a detector's results in its layout.
        image_size: (height, width) of the image in pixels.
        names: Names of further category ids, for classes that are not KITTI's, or for KITTI's in the place of its own;
            0 is passed over.

    Raises:
        MaskError: A class without category id, or a box that is none.
        FileFormatError: The file is broken; see `read_kitti_objects`.
    """
    objects = read_boxes(path, names=names)
    with within(path):
        return InstanceMasks.from_boxes(image_size=image_size, **objects)


def _category(index: int, box: KittiObject, ids: Mapping[str, int]) -> int:
    if folded(box.type) not in ids:
        known = ", ".join(KITTI_CATEGORIES)
        raise MaskError(
            f"box {index}: class {box.type!r} is none of {known}; pass names={{104: {box.type!r}}} to give it an id"
        )
    return ids[folded(box.type)]


def _score(index: int, box: KittiObject) -> float:
    score = 1.0 if box.score is None else box.score
    if not 0 <= score <= 1:
        raise MaskError(
            f"box {index}: score is {score}, expected 0 to 1; KITTI allows any number: map the detector's scores "
            "to 0 to 1 first"
        )
    return score
