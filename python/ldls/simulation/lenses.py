"""Cameras with a lens that is no pinhole's."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Distortion
from ldls.errors import CalibrationError
from ldls.simulation.cameras import CameraModel, MountedCamera

F64 = NDArray[np.float64]
STEPS = 30
"""Fixed-point steps; lenses that robots carry need ten for a millionth of a pixel."""


@dataclass(frozen=True)
class LensModel(CameraModel):
    """A camera whose lens departs from a pinhole by plumb_bob or rational_polynomial.

    Its rays are those of the lens, so what it photographs is exact: no image is warped.

    Attributes:
        distortion: The lens.
    """

    distortion: Distortion = field(default_factory=Distortion)

    def directions(self) -> F64:
        """(height * width, 3) unit vectors of the pixels in the camera frame (x right, y down, z forward), by rows."""
        pinhole = super().directions()
        rays = np.column_stack([undistorted(pinhole[:, :2] / pinhole[:, 2:], self.distortion), np.ones(len(pinhole))])
        unit: F64 = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return unit


def distorted(points: F64, distortion: Distortion) -> F64:
    """(n, 2) x / z and y / z as the lens shows them, by the model of ROS and OpenCV."""
    radial, tangential = _parts(points, distortion)
    return points * radial + tangential


def undistorted(points: F64, distortion: Distortion) -> F64:
    """(n, 2) x / z and y / z of what the lens shows at `points` (n, 2).

    Raises:
        CalibrationError: The lens folds back on itself within the image, or is a fisheye.
    """
    if distortion.model == "equidistant":
        raise CalibrationError("distortion: equidistant lenses are not simulated, expected plumb_bob")
    found = points
    for _ in range(STEPS):
        radial, tangential = _parts(found, distortion)
        found = (points - tangential) / radial
    if not np.abs(distorted(found, distortion) - points).max(initial=0) < 1e-9:
        raise CalibrationError(f"distortion: {distortion} folds back on itself within the image")
    return found


def _parts(points: F64, distortion: Distortion) -> tuple[F64, F64]:
    """(n, 1) factor along the radius and (n, 2) shift of tangential distortion."""
    _, coefficients = distortion.as_core()
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients if len(coefficients) else np.zeros(8)
    x, y = points.T
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    shift = (2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
    return radial[:, None], np.column_stack(shift)


ROBOT_LENS = MountedCamera(
    LensModel(640, 480, 525.0, (319.5, 239.5), Distortion("plumb_bob", (-0.28, 0.09, 0.0006, -0.0004, 0.0))),
    (0.10, 0.0, -0.12),
)
"""The robot's camera with a wide-angle lens: straight lines bow outwards by some 30 pixels at the corners."""
