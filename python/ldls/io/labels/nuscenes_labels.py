"""nuScenes' labels: lidarseg (uint8 a point) and panoptic (uint16 a point, class * 1000 + instance).

Source: https://github.com/nutonomy/nuscenes-devkit/blob/master/docs/instructions_lidarseg.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.categories import own_name
from ldls.errors import CorruptFileError, InputError, LimitError
from ldls.io.arrays import open_npz, write_npz
from ldls.io.files import open_file, whole_file
from ldls.labeling import Labeling
from ldls.segmentation import Segmentation

INSTANCES_A_CLASS = 1000

CLASS_NAMES: tuple[str, ...] = (
    "noise", "animal", "human.pedestrian.adult", "human.pedestrian.child", "human.pedestrian.construction_worker",
    "human.pedestrian.personal_mobility", "human.pedestrian.police_officer", "human.pedestrian.stroller",
    "human.pedestrian.wheelchair", "movable_object.barrier", "movable_object.debris",
    "movable_object.pushable_pullable", "movable_object.trafficcone", "static_object.bicycle_rack",
    "vehicle.bicycle", "vehicle.bus.bendy", "vehicle.bus.rigid", "vehicle.car", "vehicle.construction",
    "vehicle.emergency.ambulance", "vehicle.emergency.police", "vehicle.motorcycle", "vehicle.trailer",
    "vehicle.truck", "flat.driveable_surface", "flat.other", "flat.sidewalk", "flat.terrain", "static.manmade",
    "static.other", "static.vegetation", "vehicle.ego",
)  # fmt: skip
"""The 32 general classes by their numbers."""
NUSCENES: dict[int, str] = dict(enumerate(CLASS_NAMES))

LIDARSEG: dict[str, tuple[str, ...]] = {
    "barrier": ("movable_object.barrier",),
    "bicycle": ("vehicle.bicycle",),
    "bus": ("vehicle.bus.bendy", "vehicle.bus.rigid"),
    "car": ("vehicle.car",),
    "construction_vehicle": ("vehicle.construction",),
    "motorcycle": ("vehicle.motorcycle",),
    "pedestrian": ("human.pedestrian.adult", "human.pedestrian.child", "human.pedestrian.construction_worker",
                   "human.pedestrian.police_officer"),
    "traffic_cone": ("movable_object.trafficcone",),
    "trailer": ("vehicle.trailer",),
    "truck": ("vehicle.truck",),
    "driveable_surface": ("flat.driveable_surface",),
    "other_flat": ("flat.other",),
    "sidewalk": ("flat.sidewalk",),
    "terrain": ("flat.terrain",),
    "manmade": ("static.manmade",),
    "vegetation": ("static.vegetation",),
}  # fmt: skip
"""The 16 classes of the lidarseg challenge, numbered there from 1, and the general ones that each holds; what is of
none does not count.

Source: nuscenes-devkit, python-sdk/nuscenes/eval/lidarseg/utils.py."""

OTHER_OBJECT = "static.other"
WIDER: dict[str, str] = {
    **{name: held for name, (held, *others) in LIDARSEG.items() if not others},
    "Person_sitting": "human.pedestrian.adult",
    **dict.fromkeys(
        ("bird", "cat", "dog", "horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe"), "animal"
    ),
    **dict.fromkeys(("traffic light", "fire hydrant", "stop sign", "parking meter", "bench"), "static.manmade"),
    "potted plant": "static.vegetation",
}  # fmt: skip
"""Class of what has none of its own; anything else is `OTHER_OBJECT`. Background and points out of view are 0,
noise."""


def read_lidarseg(path: str | PathLike[str], *, classes: Mapping[int, str] = NUSCENES) -> Labeling:
    """Labels of a `_lidarseg.bin` file, one a point; there are no instances.

    Raises:
        CorruptFileError: A point has a class that is none of `classes`, names by number; the message names it.
        FileNotFoundError: There is no such file.
    """
    with open_file(path, "file of labels") as file:
        try:
            return Labeling.from_codes(np.frombuffer(file.read(), np.uint8), classes)
        except InputError as error:
            raise CorruptFileError(f"{error}; is it a point cloud?") from None


def read_panoptic(path: str | PathLike[str], *, classes: Mapping[int, str] = NUSCENES) -> Labeling:
    """Labels of a `_panoptic.npz` file, one a point; instances by their whole numbers, which differ between classes.

    Raises:
        CorruptFileError: It is not a whole `.npz` file with one array `data` of such labels, or a point has a class
            that is none of `classes`, names by number.
        FileNotFoundError: There is no such file.
    """
    with open_npz(path) as arrays:
        labels = arrays.get("data")
        if labels is None or labels.ndim != 1 or labels.dtype.kind not in "iu":
            raise CorruptFileError(f"found arrays {arrays.listed()}, expected 'data' with a uint16 a point")
        try:
            instances = np.where(labels % INSTANCES_A_CLASS > 0, labels, 0)
            return Labeling.from_codes(labels // INSTANCES_A_CLASS, classes, instances=instances)
        except InputError as error:
            raise CorruptFileError(str(error)) from None


def write_lidarseg(path: Path, result: Segmentation) -> None:
    """Write the class of each point in the order of the cloud, one byte a point."""
    with whole_file(path) as file:
        file.write(result.per_point(_classes(result)).astype(np.uint8).tobytes())


def write_panoptic(path: Path, result: Segmentation) -> None:
    """Write class * 1000 + instance of each point in the order of the cloud; a tracked instance has its track.

    Other instances count from 1 in each class.

    Raises:
        LimitError: A class has more than 999 instances, or a track is beyond 999.
    """
    classes = _classes(result)
    if any(instance.track for instance in result.instances):
        numbers = result.instance_ids
        if numbers.max() >= INSTANCES_A_CLASS:
            raise LimitError(
                f"{path}: track {numbers.max()}, expected at most {INSTANCES_A_CLASS - 1}; track each scene "
                "alone, or save .npz or .label instead"
            )
    else:
        counters = {one: count(1) for one in classes.tolist()}
        numbers = np.array([0, *(next(counters[one]) for one in classes[1:].tolist())], np.int64)
    if numbers.max() >= INSTANCES_A_CLASS:
        crowded = CLASS_NAMES[classes[numbers.argmax()]]
        raise LimitError(
            f"{path}: {numbers.max()} instances of {crowded}, expected at most {INSTANCES_A_CLASS - 1}; "
            "save .npz, .label or .ply instead"
        )
    write_npz(path, {"data": result.per_point(classes * INSTANCES_A_CLASS + numbers).astype(np.uint16)})


def _classes(result: Segmentation) -> NDArray[np.int64]:
    """(M + 1,) class of the background, then of each instance."""
    names = [own_name(instance.name, CLASS_NAMES, WIDER) or OTHER_OBJECT for instance in result.instances]
    return np.array([0, *(CLASS_NAMES.index(name) for name in names)], np.int64)
