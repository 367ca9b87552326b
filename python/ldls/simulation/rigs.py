"""Rigs: a lidar at its height and the cameras around it, pinholes or with a lens."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ldls.camera import Camera, Distortion
from ldls.checks import choice
from ldls.cloud import Floats
from ldls.errors import CalibrationError
from ldls.simulation.lidars import LIDARS, Lidar

STEPS = 30
"""Fixed-point steps that undistort; lenses that robots carry need ten for a millionth of a pixel."""


@dataclass(frozen=True)
class CameraModel:
    """The optics of a camera; pixel centres lie at integer coordinates.

    Rays are those of the lens, so a photograph is exact: no image is warped.

    Attributes:
        width: Columns of its image.
        height: Rows of its image.
        focal_px: Focal length in pixels.
        center_px: (u, v) of the optical axis.
        distortion: How the lens departs from a pinhole, by plumb_bob or rational_polynomial.
    """

    width: int
    height: int
    focal_px: float
    center_px: tuple[float, float]
    distortion: Distortion = field(default_factory=Distortion)

    def projection(self) -> Floats:
        """(3, 4) from homogeneous points in the camera frame to homogeneous pixels."""
        (u, v), f = self.center_px, self.focal_px
        return np.array([[f, 0, u, 0], [0, f, v, 0], [0, 0, 1, 0]], np.float64)

    def directions(self) -> Floats:
        """(height * width, 3) unit vectors of the pixels in the camera frame (x right, y down, z forward), by rows.

        Raises:
            CalibrationError: The lens folds back on itself within the image, or is a fisheye.
        """
        v, u = np.mgrid[: self.height, : self.width]
        x, y = (u - self.center_px[0]) / self.focal_px, (v - self.center_px[1]) / self.focal_px
        across = np.column_stack([x.ravel(), y.ravel()])
        if not self.distortion.is_none:
            across = undistorted(across, self.distortion)
        rays = np.column_stack([across, np.ones(len(across))])
        unit: Floats = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return unit


@dataclass(frozen=True)
class MountedCamera:
    """A camera on a rig.

    Attributes:
        model: Its optics.
        position_m: Its centre in the lidar frame, in metres.
        yaw_deg: Its heading, to the left of straight ahead.
    """

    model: CameraModel
    position_m: tuple[float, float, float]
    yaw_deg: float = 0.0

    def T_camera_lidar(self) -> Floats:
        """(4, 4) from lidar to camera coordinates."""
        c, s = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        transform = np.eye(4)
        transform[:3, :3] = [[s, -c, 0], [0, 0, -1], [c, s, 0]]  # rows: right, down and forward of the camera
        transform[:3, 3] = -transform[:3, :3] @ np.array(self.position_m)
        return transform

    def calibration(self) -> Camera:
        """The camera as it is, without any error."""
        model = self.model
        return Camera(
            projection=model.projection(),
            T_camera_lidar=self.T_camera_lidar(),
            image_size=(model.height, model.width),
            distortion=model.distortion,
        )


@dataclass(frozen=True)
class Rig:
    """A lidar and its cameras, the one that looks ahead first.

    Attributes:
        lidar: The lidar.
        height_m: Its height above the ground, in metres.
        cameras: The cameras; `cameras[0]` looks ahead.
    """

    lidar: Lidar
    height_m: float
    cameras: tuple[MountedCamera, ...]


def distorted(points: Floats, distortion: Distortion) -> Floats:
    """(n, 2) x / z and y / z as the lens shows them, by the model of ROS and OpenCV."""
    radial, tangential = _parts(points, distortion)
    return points * radial + tangential


def undistorted(points: Floats, distortion: Distortion) -> Floats:
    """(n, 2) x / z and y / z that the lens shows at `points` (n, 2).

    Raises:
        CalibrationError: The lens folds back on itself within the image, or is a fisheye.
    """
    if distortion.model == "equidistant":
        raise CalibrationError("distortion: equidistant lenses are not simulated, expected plumb_bob")
    before = points
    for _ in range(STEPS):
        radial, tangential = _parts(before, distortion)
        before = (points - tangential) / radial
    if not np.abs(distorted(before, distortion) - points).max(initial=0) < 1e-9:
        raise CalibrationError(f"distortion: {distortion} folds back on itself within the image")
    return before


def _parts(points: Floats, distortion: Distortion) -> tuple[Floats, Floats]:
    """(n, 1) factor along the radius and (n, 2) shift of tangential distortion.

    Raises:
        CalibrationError: The lens has a thin prism, or its sensor is tilted.
    """
    _, coefficients = distortion.as_core()
    (k1, k2, p1, p2, k3, k4, k5, k6), beyond = np.split(coefficients if len(coefficients) else np.zeros(14), [8])
    if beyond.any():
        raise CalibrationError("distortion: thin prisms and tilted sensors are not simulated, expected 8 coefficients")
    x, y = points.T
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    shift = (2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
    return radial[:, None], np.column_stack(shift)


KITTI = CameraModel(1242, 375, 721.5377, (609.5593, 172.854))
"""KITTI's left colour camera, rectified (P2)."""
ROBOT = CameraModel(640, 480, 525.0, (319.5, 239.5))
"""A camera as robots carry it: 63 degrees wide."""
ROBOT_LENS = replace(ROBOT, distortion=Distortion("plumb_bob", (-0.28, 0.09, 0.0006, -0.0004, 0.0)))
"""The robot's camera with a wide-angle lens: straight lines bow outwards by some 30 pixels at the corners."""
NUSCENES = CameraModel(1600, 900, 1266.4, (816.3, 491.5))
"""nuScenes' cameras but the one that looks back."""
NUSCENES_BACK = CameraModel(1600, 900, 809.2, (829.2, 481.8))
"""nuScenes' camera that looks back, wider than the others."""


def _ring() -> tuple[MountedCamera, ...]:
    """Six cameras on a circle of 0.6 m: front, front left, back left, back, back right, front right."""
    turns = (0.0, 55.0, 110.0, 180.0, -110.0, -55.0)
    places = [(0.6 * np.cos(a), 0.6 * np.sin(a), -0.3) for a in np.radians(turns)]
    models = [NUSCENES_BACK if yaw == 180.0 else NUSCENES for yaw in turns]
    return tuple(
        MountedCamera(model, (float(x), float(y), z), yaw)
        for model, (x, y, z), yaw in zip(models, places, turns, strict=True)
    )


MOUNTS: dict[str, tuple[float, tuple[MountedCamera, ...]]] = {
    "kitti": (1.73, (MountedCamera(KITTI, (0.27, 0.06, -0.08)),)),
    "robot": (0.75, (MountedCamera(ROBOT, (0.10, 0.0, -0.12)),)),
    "ring": (1.84, _ring()),
}
"""Height of the lidar and the cameras, by the name that `ldls simulate --rig` takes."""


def make_rig(*, lidar: str = "hdl-64e", camera: str = "kitti") -> Rig:
    """The rig of a lidar and of a set of cameras, by their names.

    Raises:
        ParameterError: A name is unknown.
    """
    return Rig(LIDARS[choice("lidar", lidar, LIDARS)], *MOUNTS[choice("camera", camera, MOUNTS)])
