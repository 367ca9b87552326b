"""Class names of the data sets that can be read, by their numbers, and which of them mean the same."""

from __future__ import annotations

from ldls.io.nuscenes_labels import CLASS_NAMES
from ldls.labeling import BACKGROUND

KITTI: tuple[str, ...] = (
    "Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist", "Tram", "Misc", "DontCare",
)  # fmt: skip
"""Classes of KITTI's object labels."""

SQUEEZESEG: dict[int, str] = {0: BACKGROUND, 1: "car", 2: "pedestrian", 3: "cyclist"}

SEMANTIC_KITTI: dict[int, str] = {
    0: "unlabeled", 1: "outlier", 10: "car", 11: "bicycle", 13: "bus", 15: "motorcycle", 16: "on-rails", 18: "truck",
    20: "other-vehicle", 30: "person", 31: "bicyclist", 32: "motorcyclist", 40: "road", 44: "parking", 48: "sidewalk",
    49: "other-ground", 50: "building", 51: "fence", 52: "other-structure", 60: "lane-marking", 70: "vegetation",
    71: "trunk", 72: "terrain", 80: "pole", 81: "traffic-sign", 99: "other-object", 252: "moving-car",
    253: "moving-bicyclist", 254: "moving-person", 255: "moving-motorcyclist", 256: "moving-on-rails",
    257: "moving-bus", 258: "moving-truck", 259: "moving-other-vehicle",
}  # fmt: skip

NUSCENES: dict[int, str] = dict(enumerate(CLASS_NAMES))
"""The 32 general classes of nuScenes lidarseg."""

VOID: tuple[str, ...] = ("unlabeled", "outlier", "noise", "vehicle.ego")
"""Names under which a data set says that it does not know, or that the sensor saw its own car."""

SYNONYMS: tuple[tuple[str, ...], ...] = (
    ("Car", "car", "moving-car", "vehicle.car"),
    ("Pedestrian", "pedestrian", "person", "moving-person",
     *(name for name in NUSCENES.values() if name.startswith("human.pedestrian."))),
    ("Cyclist", "cyclist", "bicyclist", "moving-bicyclist"),
    ("Truck", "truck", "moving-truck", "vehicle.truck"),
    ("Tram", "train", "on-rails", "moving-on-rails"),
    ("bicycle", "vehicle.bicycle"),
    ("motorcycle", "vehicle.motorcycle"),
    ("bus", "moving-bus", "vehicle.bus.bendy", "vehicle.bus.rigid"),
)  # fmt: skip
"""Names of one class in KITTI, COCO, SqueezeSeg, SemanticKITTI and nuScenes."""


def synonyms(name: str) -> tuple[str, ...]:
    """All names that mean the class `name`, itself among them."""
    return next((group for group in SYNONYMS if name in group), (name,))
