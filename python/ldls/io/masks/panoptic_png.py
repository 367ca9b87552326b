"""COCO panoptic: JSON of segments beside PNG whose colours number them, R + 256 G + 65536 B.

Source: https://cocodataset.org/#format-data.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ldls.categories import is_object
from ldls.errors import CorruptFileError, MaskError
from ldls.io.files import strictly_below
from ldls.io.images import read_image
from ldls.masks import InstanceMasks, instance_image
from ldls.masks.coco import chosen_image


def is_panoptic(content: Mapping[str, Any]) -> bool:
    """True if annotations list the segments of an image."""
    annotations = content.get("annotations")
    return isinstance(annotations, list) and any("segments_info" in a for a in annotations if isinstance(a, dict))


def read(path: Path, content: Mapping[str, Any], *, image_id: int | str | None = None) -> InstanceMasks:
    """The things of one image; stuff (isthing 0) is background.

    Args:
        path: The JSON file; the PNG lie beside it, or in the folder of its name.
        content: The parsed JSON.
        image_id: Which image, where there are several.

    Raises:
        MaskError: There is no such image, or several and none was chosen.
        CorruptFileError: A segment that the PNG does not have, or a category that is not among the categories.
        FileNotFoundError: The PNG is not there.
    """
    annotations = content["annotations"]
    chosen = chosen_image(annotations, {image["id"]: image for image in content.get("images", ())}, image_id)
    (annotation,) = [a for a in annotations if a["image_id"] == chosen]
    categories = {category["id"]: category for category in content["categories"]}
    names = [strictly_below(folder, annotation["file_name"], place=str(path)) for folder in _folders(path)]
    colours = read_image(next((name for name in names if name.exists()), names[0]))
    values = colours.astype(np.int64) @ [1, 256, 65536]
    numbers, rles = instance_image.split(values)
    segments = {segment["id"]: segment["category_id"] for segment in annotation["segments_info"]}
    missing = sorted(segments.keys() - set(numbers.tolist()))
    if missing:
        raise CorruptFileError(f"segment {missing[0]} has no pixel in {annotation['file_name']}")
    unknown = sorted(set(segments.values()) - categories.keys())
    if unknown:
        raise MaskError(f"category_id {unknown[0]} is not among the categories")
    things = [
        (rle, segments[number])
        for number, rle in zip(numbers.tolist(), rles, strict=True)
        if number in segments and _is_thing(categories[segments[number]])
    ]
    return InstanceMasks(
        [rle for rle, _ in things],
        (values.shape[0], values.shape[1]),
        categories=np.array([category for _, category in things], np.int64),
        names={category: str(record["name"]) for category, record in categories.items()},
    )


def _is_thing(category: Mapping[str, Any]) -> bool:
    return bool(category.get("isthing", 1)) and is_object(str(category["name"]))


def _folders(path: Path) -> tuple[Path, Path]:
    return path.parent, path.parent / path.stem
