"""Cameras: pinholes, and which way they look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class CameraModel:
    """A pinhole camera without distortion; pixel centres lie at integer coordinates.

    Attributes:
        width: Columns of its image.
        height: Rows of its image.
        focal_px: Focal length in pixels.
        center_px: (u, v) of the optical axis.
    """

    width: int
    height: int
    focal_px: float
    center_px: tuple[float, float]

    def projection(self) -> NDArray[np.float64]:
        """(3, 4) from homogeneous points in the camera frame to homogeneous pixels."""
        (u, v), f = self.center_px, self.focal_px
        return np.array([[f, 0, u, 0], [0, f, v, 0], [0, 0, 1, 0]], np.float64)

    def directions(self) -> NDArray[np.float64]:
        """(height * width, 3) unit vectors of the pixels in the camera frame (x right, y down, z forward), by rows."""
        v, u = np.mgrid[: self.height, : self.width]
        x, y = (u - self.center_px[0]) / self.focal_px, (v - self.center_px[1]) / self.focal_px
        rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
        unit: NDArray[np.float64] = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return unit


@dataclass(frozen=True)
class MountedCamera:
    """A camera on a rig.

    Attributes:
        model: Its optics.
        position_m: Its centre in the lidar frame, in metres.
        yaw_deg: Where it looks, to the left of straight ahead.
    """

    model: CameraModel
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0

    def T_camera_lidar(self) -> NDArray[np.float64]:
        """(4, 4) from lidar to camera coordinates."""
        c, s = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        transform = np.eye(4)
        transform[:3, :3] = [[s, -c, 0], [0, 0, -1], [c, s, 0]]  # rows: right, down and forward of the camera
        transform[:3, 3] = -transform[:3, :3] @ np.array(self.position_m)
        return transform


KITTI = CameraModel(1242, 375, 721.5377, (609.5593, 172.854))
"""KITTI's left colour camera, rectified (P2)."""
ROBOT = CameraModel(640, 480, 525.0, (319.5, 239.5))
"""A camera as robots carry it: 63 degrees wide."""
NUSCENES = CameraModel(1600, 900, 1266.4, (816.3, 491.5))
"""nuScenes' cameras but the one that looks back."""
NUSCENES_BACK = CameraModel(1600, 900, 809.2, (829.2, 481.8))
"""nuScenes' camera that looks back, wider than the others."""
