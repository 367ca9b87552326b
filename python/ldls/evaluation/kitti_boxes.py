"""KITTI's 3D boxes as truth for points: noisy, for a box holds ground and air as well as its object."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.camera import Camera
from ldls.cloud import as_points
from ldls.evaluation.vocabularies import KITTI
from ldls.io.kitti_objects import KittiObject, read_kitti_objects
from ldls.labeling import BACKGROUND, Labeling
from ldls.stages import project

IMAGE_SIZE = (375, 1242)
"""Height and width of most of KITTI's images, where that of the frame is not known."""


def read_kitti_boxes(path: str | PathLike[str], *, points: ArrayLike, camera: Camera) -> Labeling:
    """Labels of `points` by the label_2 file of their frame; see `label_by_boxes`.

    Raises:
        FileFormatError: The file is broken; see `read_kitti_objects`.
        InputError: The points cannot be used.
    """
    return label_by_boxes(read_kitti_objects(path), points, camera)


def label_by_boxes(objects: Sequence[KittiObject], points: ArrayLike, camera: Camera) -> Labeling:
    """Class of the box that holds each point; its instance is the number of the row, from 1.

    Of several boxes the smallest wins: who stands at a car is smaller than the car's box. Points outside all boxes
    whose pixel lies in a DontCare rectangle are DontCare, which `ClassSet.kitti` leaves out unless told otherwise.
    Points out of the camera's view are ignored. A row without a box, its dimensions -1, holds no point.

    Args:
        objects: Rows of a label_2 file.
        points: (N, >= 3) in metres in the lidar frame.
        camera: The frame's camera; without an image size, that of most of KITTI's images.
    """
    cloud = as_points(points)
    in_view, pixels = project(cloud, camera, image_size=camera.image_size or IMAGE_SIZE, keep_origin=True)
    names = tuple(dict.fromkeys([BACKGROUND, *KITTI, *(found.type for found in objects)]))
    classes, instances = np.zeros((2, len(cloud)), np.int32)
    for region in (found for found in objects if found.is_region):
        classes[in_view[_in_rectangle(pixels, region)]] = names.index(region.type)
    seen = in_camera_frame(cloud[in_view], camera)
    boxes = [(row, found) for row, found in enumerate(objects, start=1) if not found.is_region]
    for row, found in sorted(boxes, key=lambda box: -np.prod(box[1].dimensions)):
        inside = in_view[points_in_box(seen, found)]
        classes[inside], instances[inside] = names.index(found.type), row
    ignored = np.ones(len(cloud), bool)
    ignored[in_view] = False
    return Labeling(classes, instances, ignored, names)


def in_camera_frame(points: ArrayLike, camera: Camera) -> NDArray[np.float64]:
    """(N, 3) `points` of the lidar frame in the rectified camera frame, in metres: x right, y down, z forward."""
    xyz = np.asarray(points)[:, :3].astype(np.float64)
    transform = camera.T_camera_lidar
    # infinite coordinates become NaN, which lies in no box
    with np.errstate(invalid="ignore"):
        placed: NDArray[np.float64] = xyz @ transform[:3, :3].T + transform[:3, 3]
    return placed


def in_box_frame(points_camera: NDArray[np.float64], found: KittiObject) -> NDArray[np.float64]:
    """(N, 3) points of the camera frame along the length, up from the bottom, and across the width, in metres."""
    x, y, z = (points_camera - found.location).T
    cos, sin = np.cos(found.rotation_y), np.sin(found.rotation_y)
    with np.errstate(invalid="ignore"):
        return np.stack([cos * x - sin * z, -y, sin * x + cos * z], axis=1)


def points_in_box(points_camera: NDArray[np.float64], found: KittiObject) -> NDArray[np.bool_]:
    """(N,) which points of the camera frame lie in the box, its faces included."""
    height, width, length = found.dimensions
    along, up, across = in_box_frame(points_camera, found).T
    inside: NDArray[np.bool_] = (
        (np.abs(along) <= length / 2) & (np.abs(across) <= width / 2) & (up >= 0) & (up <= height)
    )
    return inside


def _in_rectangle(pixels: NDArray[np.float64], region: KittiObject) -> NDArray[np.bool_]:
    left, top, right, bottom = region.bbox
    u, v = pixels.T
    inside: NDArray[np.bool_] = (u >= left) & (u <= right) & (v >= top) & (v <= bottom)
    return inside
