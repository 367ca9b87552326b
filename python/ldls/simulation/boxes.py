"""Objects as rows of KITTI's label_2 files."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.categories import COCO_NAMES
from ldls.simulation import objects
from ldls.simulation.frame import View
from ldls.simulation.objects import SceneObject

KITTI_NAMES = {objects.PERSON: "Pedestrian", objects.CAR: "Car", objects.TRUCK: "Truck"}
"""KITTI's names of COCO's categories; KITTI calls everything else Misc."""
NEAREST_M = 0.5


def kitti_name(category: int) -> str:
    """Name in label_2: Car, Pedestrian, Truck or Misc."""
    return KITTI_NAMES.get(category, "Misc")


def annotation_name(category: int) -> str:
    """Name in point annotations: KITTI's where it has one, else COCO's."""
    return KITTI_NAMES.get(category, COCO_NAMES[category])


def label_rows(things: tuple[SceneObject, ...], view: View) -> list[str]:
    """A row of 15 fields for each object that the image shows, in the camera frame of the calibration as given.

    The 2D box is that of the projected corners, cut at the image's edges. Occlusion is 0 where at least 0.7 of the
    object is visible, 1 from 0.35, else 2.
    """
    shown = np.bincount(view.pixels.instances.ravel(), minlength=len(things) + 1)[1:]
    rows = [
        _row(thing, view.camera, float(count / max(expected, 1.0)))
        for thing, count, expected in zip(things, shown, view.pixels.expected_px, strict=True)
        if count > 0
    ]
    return [row for row in rows if row]


def _row(thing: SceneObject, camera: Camera, visible: float) -> str:
    bottom = np.array([*thing.centre_m[:2], thing.centre_m[2] - thing.height_m / 2])
    x, y, z = _to_camera(camera, bottom[None])[0]
    if z < NEAREST_M:
        return ""
    heading = np.array([np.cos(thing.yaw), np.sin(thing.yaw), 0.0])
    ahead = camera.T_camera_lidar[:3, :3] @ heading
    turn = float(np.arctan2(-ahead[2], ahead[0]))
    alpha = _wrapped(turn - float(np.arctan2(x, z)))
    box, truncated = _image_box(thing, camera)
    occluded = 0 if visible >= 0.7 else 1 if visible >= 0.35 else 2
    size = (thing.height_m, thing.width_m, thing.length_m)
    numbers = " ".join(f"{n:.2f}" for n in (alpha, *box, *size, x, y, z, turn))
    return f"{kitti_name(thing.category)} {truncated:.2f} {occluded} {numbers}"


def _image_box(thing: SceneObject, camera: Camera) -> tuple[tuple[float, float, float, float], float]:
    """(left, top, right, bottom) within the image, and the share of the box outside it."""
    corners = _to_camera(camera, thing.corners_m())
    corners[:, 2] = np.maximum(corners[:, 2], 0.2)
    homogeneous = np.column_stack([corners, np.ones(8)]) @ camera.projection.T
    uv = homogeneous[:, :2] / homogeneous[:, 2:]
    height, width = camera.image_size or (0, 0)
    low, high = uv.min(axis=0), uv.max(axis=0)
    cut_low, cut_high = (np.clip(edge, 0, (width - 1, height - 1)) for edge in (low, high))
    share = float(np.prod(cut_high - cut_low) / max(float(np.prod(high - low)), 1e-9))
    box = (float(cut_low[0]), float(cut_low[1]), float(cut_high[0]), float(cut_high[1]))
    return box, float(np.clip(1 - share, 0, 1))


def _to_camera(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    transform = camera.T_camera_lidar
    moved: NDArray[np.float64] = points @ transform[:3, :3].T + transform[:3, 3]
    return moved


def _wrapped(angle: float) -> float:
    return (angle + np.pi) % (2 * np.pi) - np.pi
