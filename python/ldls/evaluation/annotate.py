"""Point annotations started from KITTI's boxes and cleaned of the ground, as the paper's annotators began."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.camera import Camera
from ldls.cloud import as_points
from ldls.evaluation.kitti_boxes import in_box_frame, in_camera_frame, label_by_boxes
from ldls.evaluation.kitti_objects import KittiObject
from ldls.evaluation.labeling import Labeling

GROUND_THICKNESS_M = 0.15
"""Points this near the ground belong to it: returns scatter by centimetres, and tyres and shoes hide little more."""
SURROUNDINGS_M = 1.0
"""How far around a box the ground is looked for."""
BOX_ERROR_M = 0.5
"""How far the ground can lie above or below the bottom of a box."""
LOWEST_SHARE = 0.1
"""Share of the returns around a box that counts as its lowest; single returns lie below the ground by reflection."""


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
        pairs = set(zip(self.labeling.classes.tolist(), self.labeling.instances.tolist(), strict=True))
        return dict(Counter(self.labeling.names[k] for k, instance in pairs if instance))


def annotate(objects: Sequence[KittiObject], points: ArrayLike, camera: Camera, *, clean: bool = True) -> Annotation:
    """Annotations of `points` by the boxes that hold them, as `label_by_boxes` makes them.

    Args:
        objects: Rows of a label_2 file.
        points: (N, >= 3) in metres in the lidar frame.
        camera: The frame's camera.
        clean: Whether points within `GROUND_THICKNESS_M` of the ground under an object leave it.
    """
    labeling = label_by_boxes(objects, points, camera)
    if not clean:
        return Annotation(labeling, 0)
    placed = in_camera_frame(as_points(points), camera)
    ground = np.zeros(len(labeling), bool)
    for row, found in enumerate(objects, start=1):
        members = np.flatnonzero(labeling.instances == row)
        if len(members):
            up = in_box_frame(placed[members], found)[:, 1]
            ground[members] = up <= ground_height(placed, found) + GROUND_THICKNESS_M
    classes, instances = (np.where(ground, 0, values) for values in (labeling.classes, labeling.instances))
    return Annotation(replace(labeling, classes=classes, instances=instances), int(ground.sum()))


def ground_height(points_camera: NDArray[np.float64], found: KittiObject) -> float:
    """Height of the ground above the bottom of a box, in metres, by the lowest returns around it.

    Without a return around it, the ground is where the box ends.

    Args:
        points_camera: (N, 3) points in the rectified camera frame.
        found: The object with the box.
    """
    _, width, length = found.dimensions
    # what no box can reach is most of the cloud, and cheap to leave out
    away = np.abs(points_camera - found.location)
    near = points_camera[(away <= length + width + SURROUNDINGS_M).all(axis=1)]
    along, up, across = in_box_frame(near, found).T
    beside = np.maximum(np.abs(along) - length / 2, np.abs(across) - width / 2)
    around = up[(beside > 0) & (beside <= SURROUNDINGS_M) & (np.abs(up) <= BOX_ERROR_M)]
    return float(np.quantile(around, LOWEST_SHARE)) if len(around) else 0.0
