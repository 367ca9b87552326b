"""How near simulated frames are to real ones, in three numbers each that the method depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.camera import Camera
from ldls.io.labels.kitti_objects import KittiObject, in_camera_frame
from ldls.masks import InstanceMasks
from ldls.stages import direct_labels, project

ELEVATIONS_DEG = np.arange(-24.0, 2.1, 2.0)
RANGES_M = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0)
CATEGORIES = {"Car": 3, "Pedestrian": 1, "Person_sitting": 1}
"""COCO's categories of KITTI's boxes."""
GROUND_M = 0.1


@dataclass(frozen=True, eq=False)
class LabelledCloud:
    """A frame with a label for each point, simulated or real.

    Attributes:
        points: (N, >= 3) in the lidar frame, in metres.
        instances: (N,) object of each point, 0 for none.
        categories: (N,) COCO id of each point, 0 for none.
        masks: What a segmenter finds.
        camera: The calibration.
    """

    points: NDArray[np.float32]
    instances: NDArray[np.int32]
    categories: NDArray[np.int32]
    masks: InstanceMasks
    camera: Camera


def points_by_elevation(points: ArrayLike) -> NDArray[np.float64]:
    """Share of the points in each band of 2 degrees of elevation, from -24 to 2."""
    xyz = np.asarray(points, np.float64)[:, :3]
    rise = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    counts: NDArray[np.float64] = np.histogram(rise, ELEVATIONS_DEG)[0] / len(xyz)
    return counts


def points_by_range(clouds: Sequence[LabelledCloud], category: int) -> NDArray[np.float64]:
    """Median points of an object of `category` in each band of RANGES_M; NaN where there is none."""
    found = [
        (float(np.median(np.linalg.norm(c.points[mine, :2], axis=1))), int(mine.sum()))
        for c in clouds
        for m in np.unique(c.instances[c.categories == category])
        if (mine := c.instances == m).any()
    ]
    distance, counts = np.array(found, np.float64).reshape(-1, 2).T
    bands = np.digitize(distance, RANGES_M)
    chosen = [counts[bands == k] for k in range(1, len(RANGES_M))]
    return np.array([np.median(c) if len(c) else np.nan for c in chosen])


def mask_overlap(clouds: Sequence[LabelledCloud], category: int) -> tuple[float, float]:
    """Precision and recall of direct projection for a category, over all points in view; NaN without points."""
    hits = claimed = true = 0
    for cloud in clouds:
        size = cloud.masks.image_size
        in_view, pixels = project(cloud.points, cloud.camera, image_size=size)
        of_mask = np.append(np.int32(0), cloud.masks.categories)
        labels, truth = of_mask[direct_labels(pixels, cloud.masks)] == category, cloud.categories[in_view] == category
        hits, claimed, true = hits + int((labels & truth).sum()), claimed + int(labels.sum()), true + int(truth.sum())
    return hits / claimed if claimed else float("nan"), hits / true if true else float("nan")


def labelled_by_boxes(
    objects: Sequence[KittiObject], points: NDArray[np.float32], masks: InstanceMasks, camera: Camera
) -> LabelledCloud:
    """A real frame, its points labelled by KITTI's boxes of cars and people.

    A box's lowest 0.1 m is left out, as ground stands in it.
    """
    seen = in_camera_frame(points, camera)
    instances, categories = np.zeros(len(points), np.int32), np.zeros(len(points), np.int32)
    for number, found in enumerate((one for one in objects if one.type in CATEGORIES), start=1):
        inside = found.contains(seen) & (found.in_box_frame(seen)[:, 1] >= GROUND_M)
        instances[inside], categories[inside] = number, CATEGORIES[found.type]
    return LabelledCloud(points, instances, categories, masks, camera)
