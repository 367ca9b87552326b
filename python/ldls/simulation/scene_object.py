"""The objects of a scene and where they stand."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls.categories import COCO_NAMES
from ldls.io.masks.kitti_boxes import KITTI_CATEGORIES

PERSON, BICYCLE, CAR, MOTORCYCLE, BUS, TRUCK = 1, 2, 3, 4, 6, 8
BENCH, DOG, CHAIR, POTTED_PLANT = 15, 18, 62, 64
"""COCO's ids of the categories that scenes hold."""
CYCLIST = KITTI_CATEGORIES["Cyclist"]
"""A person on a bicycle: one object in truth, in which a segmenter of COCO finds a person and a bicycle."""
KITTI_TYPES = {PERSON: "Pedestrian", CAR: "Car", TRUCK: "Truck", CYCLIST: "Cyclist"}
CLASS_NAMES = {
    category: COCO_NAMES[category]
    for category in (PERSON, BICYCLE, CAR, MOTORCYCLE, BUS, TRUCK, BENCH, DOG, CHAIR, POTTED_PLANT)
} | KITTI_TYPES
"""Class of each category in the truth: KITTI's name where it has one, else COCO's."""


@dataclass(frozen=True)
class SceneObject:
    """One object and the upright box around it.

    Attributes:
        category: COCO id, or CYCLIST.
        centre_m: Middle of the box, in metres.
        length_m: Extent along its heading, in metres.
        width_m: Extent across, in metres.
        height_m: Extent upwards, in metres.
        yaw: Heading, in radians from x towards y.
        velocity_m_s: Metres a second along x and y.
    """

    category: int
    centre_m: tuple[float, float, float]
    length_m: float
    width_m: float
    height_m: float
    yaw: float
    velocity_m_s: tuple[float, float] = (0.0, 0.0)

    def below(self, height_m: float) -> SceneObject:
        """The object in a frame whose origin lies `height_m` higher."""
        return self.moved((0.0, 0.0, -height_m))

    def moved(self, by_m: tuple[float, float, float]) -> SceneObject:
        """The object elsewhere."""
        (x, y, z), (dx, dy, dz) = self.centre_m, by_m
        return replace(self, centre_m=(x + dx, y + dy, z + dz))

    def turned(self, yaw: float) -> SceneObject:
        """The object turned about the origin's z axis, to the left, by radians; its motion too."""
        c, s = math.cos(yaw), math.sin(yaw)
        (x, y, z), (vx, vy) = self.centre_m, self.velocity_m_s
        place, velocity = (c * x - s * y, s * x + c * y, z), (c * vx - s * vy, s * vx + c * vy)
        return replace(self, centre_m=place, yaw=self.yaw + yaw, velocity_m_s=velocity)

    def corners_m(self) -> NDArray[np.float64]:
        """(8, 3) corners of the box, in metres."""
        signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), axis=-1).reshape(-1, 3)
        local = signs * (np.array([self.length_m, self.width_m, self.height_m]) / 2)
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        corners: NDArray[np.float64] = local @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + self.centre_m
        return corners
