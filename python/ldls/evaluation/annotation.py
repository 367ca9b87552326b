"""Point annotations started from KITTI's boxes and cleaned of the ground, as the paper's annotators began."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.camera import Camera
from ldls.camera.rigid import transformed
from ldls.checks import checked
from ldls.cloud import as_points
from ldls.io.labels.kitti_objects import KittiObject, label_by_boxes
from ldls.labeling import Labeling

GROUND_THICKNESS_M = 0.15
"""Points this near the ground belong to it: returns scatter by centimetres, and tyres and shoes hide little more."""
SURROUNDINGS_M = 1.0
"""Distance from a box within which the ground is looked for."""
BOX_ERROR_M = 0.5
"""Largest height of the ground above or below the bottom of a box."""
GROUND_SCATTER_M = 0.1
"""Returns around a box that lie higher above the fitted ground than this are something else: kerbs, bushes, walls."""
ROUNDS = 5
"""Fits of the ground, each without the points that the last one left above it."""


@dataclass(frozen=True, eq=False)
class Annotation:
    """Point annotations of a frame.

    Attributes:
        labeling: Labels of its points.
        n_ground: Points taken from objects for they lay on the ground.
    """

    labeling: Labeling
    n_ground: int

    def objects(self) -> dict[str, int]:
        """Objects of each class that have points."""
        rows = np.flatnonzero(self.labeling.instances)
        pairs = np.unique(np.stack([self.labeling.classes[rows], self.labeling.instances[rows]]), axis=1)
        return dict(Counter(self.labeling.names[k] for k in pairs[0]))


@checked
def annotate(objects: Sequence[KittiObject], points: ArrayLike, camera: Camera, *, clean: bool = True) -> Annotation:
    """Annotations of `points` by the boxes that hold them, as `label_by_boxes` makes them.

    Args:
        objects: Rows of a label_2 file.
        points: (N, >= 3) in metres in the lidar frame.
        camera: The frame's camera.
        clean: Take from an object the points within `GROUND_THICKNESS_M` of the ground under it.
    """
    labeling = label_by_boxes(objects, points, camera)
    if not clean:
        return Annotation(labeling, 0)
    placed = transformed(as_points(points), camera.T_camera_lidar)
    ground = np.zeros(len(labeling), bool)
    for row, object_ in enumerate(objects, start=1):
        members = np.flatnonzero(labeling.instances == row)
        if len(members):
            along, up, across = object_.in_box_frame(placed[members]).T
            height, slope_along, slope_across = ground_plane(placed, object_)
            ground[members] = up - (height + slope_along * along + slope_across * across) <= GROUND_THICKNESS_M
    classes, instances = (np.where(ground, 0, values) for values in (labeling.classes, labeling.instances))
    return Annotation(replace(labeling, classes=classes, instances=instances), int(ground.sum()))


def ground_plane(points_camera: NDArray[np.float64], box: KittiObject) -> NDArray[np.float64]:
    """(3,) height of the ground above the middle of a box's bottom, in metres, and its slopes along and across the box.

    A plane is fitted to the returns around the box, and again to those that it does not leave above it: roads are
    cambered, and the camera's frame is tilted against them. Without a return around it, the ground is the box's bottom.

    Args:
        points_camera: (N, 3) points in the rectified camera frame.
        box: The object with the box.
    """
    along, up, across = _around(points_camera, box).T
    plane = np.zeros(3)
    kept = np.ones(len(up), bool)
    for _ in range(ROUNDS if len(up) else 0):
        # two more rows say that the ground is level, which counts where hardly a return says otherwise
        design = np.stack([np.ones(len(up)), along, across], axis=1)
        rows = np.vstack([design[kept], [[0, 1, 0], [0, 0, 1]]])
        plane = np.linalg.lstsq(rows, np.append(up[kept], [0, 0]), rcond=None)[0]
        kept = up - design @ plane <= GROUND_SCATTER_M
    return plane


def _around(points_camera: NDArray[np.float64], box: KittiObject) -> NDArray[np.float64]:
    """(n, 3) points beside a box at about the height of its bottom: along, up and across it."""
    _, width, length = box.dimensions
    # what no box can reach is most of the cloud, and cheap to leave out
    away = np.abs(points_camera - box.location)
    near = box.in_box_frame(points_camera[(away <= length + width + SURROUNDINGS_M).all(axis=1)])
    along, up, across = near.T
    beside = np.maximum(np.abs(along) - length / 2, np.abs(across) - width / 2)
    around: NDArray[np.float64] = near[(beside > 0) & (beside <= SURROUNDINGS_M) & (np.abs(up) <= BOX_ERROR_M)]
    return around
