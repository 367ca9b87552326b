"""SemanticKITTI `.label` files: uint32 a point, semantic class in the lower half, instance in the upper."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ldls.categories import own_name
from ldls.errors import CorruptFileError, InputError, LimitError, TruncatedFileError
from ldls.io.files import open_file, whole_file
from ldls.labeling import Labeling
from ldls.segmentation import Segmentation

SEMANTIC_KITTI: dict[int, str] = {
    0: "unlabeled", 1: "outlier", 10: "car", 11: "bicycle", 13: "bus", 15: "motorcycle", 16: "on-rails", 18: "truck",
    20: "other-vehicle", 30: "person", 31: "bicyclist", 32: "motorcyclist", 40: "road", 44: "parking", 48: "sidewalk",
    49: "other-ground", 50: "building", 51: "fence", 52: "other-structure", 60: "lane-marking", 70: "vegetation",
    71: "trunk", 72: "terrain", 80: "pole", 81: "traffic-sign", 99: "other-object", 252: "moving-car",
    253: "moving-bicyclist", 254: "moving-person", 255: "moving-motorcyclist", 256: "moving-on-rails",
    257: "moving-bus", 258: "moving-truck", 259: "moving-other-vehicle",
}  # fmt: skip
"""Classes by their numbers."""

NUMBERS = {name: number for number, name in SEMANTIC_KITTI.items()}
OTHER_OBJECT = "other-object"
WIDER = {"Person_sitting": "person", "stop sign": "traffic-sign", "potted plant": "vegetation"}
"""Class of what has none of its own; anything else is `OTHER_OBJECT`. Background and points out of view are 0,
unlabeled."""
LABEL_BYTES = 4
MOST_INSTANCES = (1 << 16) - 1


def read_semantic_kitti(path: str | PathLike[str]) -> Labeling:
    """Labels of a file, one a point in the order of the scan.

    Raises:
        TruncatedFileError: The size is no whole number of labels.
        CorruptFileError: A label has a class that SemanticKITTI does not; the message names the point.
        FileNotFoundError: There is no such file.
    """
    with open_file(path, "file of labels") as file:
        if file.size % LABEL_BYTES:
            raise TruncatedFileError(f"{file.size} bytes is not a multiple of 4 (uint32 a point)")
        values = np.frombuffer(file.read(), "<u4")
        try:
            return Labeling.from_codes(values & 0xFFFF, SEMANTIC_KITTI, instances=values >> 16)
        except InputError as error:
            raise CorruptFileError(str(error)) from None


def write(path: Path, result: Segmentation) -> None:
    """Write the labels of `result`, one a point in the order of the cloud; a tracked instance has its track.

    Raises:
        LimitError: An instance has a number beyond 16 bits.
    """
    names = [own_name(instance.name, NUMBERS, WIDER) or OTHER_OBJECT for instance in result.instances]
    numbers = result.instance_ids
    if numbers.max() > MOST_INSTANCES:
        raise LimitError(
            f"{path}: a .label has 16 bits for the number of an instance, got {numbers.max()}; expected at most "
            f"{MOST_INSTANCES:,}; .npz keeps any"
        )
    codes = np.array([0, *(NUMBERS[name] for name in names)], np.uint32) | numbers.astype(np.uint32) << 16
    with whole_file(path) as file:
        file.write(result.per_point(codes).astype("<u4").tobytes())
