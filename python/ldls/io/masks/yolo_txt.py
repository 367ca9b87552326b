"""Polygons of YOLO: a line an instance, the class and x y of each corner as shares of width and height.

A network's results may have the score behind the corners. Source: https://docs.ultralytics.com/datasets/segment/.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS, category_ids, is_object
from ldls.checks.values import number_of
from ldls.errors import CorruptFileError, MaskError
from ldls.io.cameras.field_file import read_fields
from ldls.io.files import read_lines
from ldls.masks import InstanceMasks

CLASSES, DATA = "classes.txt", "data.yaml"
"""Files of class names: of labelling tools, a line each, and of ultralytics."""
NUMBER = re.compile(r"[-+]?\d+(\.\d*)?")
"""The class of a line, as it is or as it may have become."""
LEAST_WORDS = 7
"""A class and the corners of a triangle."""
CONTIGUOUS_NAMES = {index: COCO_NAMES[category] for index, category in enumerate(CONTIGUOUS_IDS)}


def is_yolo(lines: Sequence[str]) -> bool:
    """True for lines of which the first begins with a number; KITTI's begin with a name."""
    first = next((line.split()[0] for line in lines if line.strip()), "")
    return NUMBER.fullmatch(first) is not None


def read(path: str | PathLike[str], *, image_size: tuple[int, int], names: Mapping[int, str] | None) -> InstanceMasks:
    """One mask for each line, but none for those of a class that is named background.

    Args:
        path: `.txt` file.
        image_size: (height, width) of the image in pixels.
        names: Name of each class by its number. Without them those of a data.yaml or classes.txt in the folder of the
            file or one of the two above it, and else COCO's 80. Names of COCO get COCO's ids, others 100 and the
            number.

    Raises:
        MaskError: Boxes instead of polygons, or a class without a name.
        CorruptFileError: A line that is none of YOLO's.
    """
    if names is None:
        names = _names_beside(Path(path)) or CONTIGUOUS_NAMES
    ids, names_of_ids = category_ids(names)
    rles, categories, scores = [], [], []
    for number, line in enumerate(read_lines(path, "polygons"), start=1):
        if not line.strip():
            continue
        place = f"{path}, line {number}"
        category, corners, score = _parsed(place, line.split())
        if category not in ids:
            raise MaskError(
                f"{place}: class {category} has no name; pass names={{{category}: '...'}}, all of those in data.yaml"
            )
        if not is_object(names[category]):
            continue
        # shares count from the outer edges of the image, as COCO's polygons do
        polygon = (corners * image_size[::-1]).ravel().tolist()
        rles.append(_ldls.Rle.from_polygons(*image_size, [polygon]))
        categories.append(ids[category])
        scores.append(score)
    return InstanceMasks(
        rles, image_size, categories=np.array(categories, np.int64), scores=scores, names=COCO_NAMES | names_of_ids
    )


def _names_beside(path: Path) -> dict[int, str]:
    """The names of the classes that the nearest file of names has; none where there is no such file."""
    for folder in path.absolute().parents[:3]:
        if (folder / CLASSES).is_file():
            return dict(enumerate(line.strip() for line in read_lines(folder / CLASSES, "class names")))
        if (folder / DATA).is_file():
            return _names_in(folder / DATA)
    return {}


def _names_in(path: Path) -> dict[int, str]:
    """The names of a data.yaml: a list, or a mapping from number."""
    found = read_fields(path).find("names")
    names = dict(enumerate(found)) if isinstance(found, list) else found
    if not isinstance(names, dict) or not all(type(key) is int for key in names):
        raise CorruptFileError(f"{path}: names: expected a list, or numbers with names")
    return {key: str(name) for key, name in names.items()}


def _parsed(place: str, words: list[str]) -> tuple[int, Any, float]:
    if not words[0].isdecimal():
        raise CorruptFileError(f"{place}: class is {words[0][:60]!r}, expected a whole number, counted from 0")
    try:
        category, numbers = int(words[0]), np.array([number_of(word) for word in words[1:]])
    except ValueError:
        raise CorruptFileError(f"{place}: expected a class and numbers, got {' '.join(words)[:60]!r}") from None
    if len(words) in (5, 6):
        raise MaskError(
            f"{place}: a box, expected a polygon of three corners or more; segment with a -seg model, or pass the "
            "boxes to InstanceMasks.from_boxes"
        )
    corners, score = (numbers[:-1], float(numbers[-1])) if len(numbers) % 2 else (numbers, 1.0)
    shares = np.append(corners, score)
    if len(words) < LEAST_WORDS or not ((shares >= -1e-6) & (shares <= 1 + 1e-6)).all():
        raise CorruptFileError(
            f"{place}: expected a class and x y of three corners or more, as shares of the image from 0 to 1"
        )
    return category, corners.reshape(-1, 2), min(max(score, 0.0), 1.0)
