"""Rigid transforms between frames of reference: (4, 4), column vectors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

import ldls._ldls as _ldls
from ldls.checks import numbers
from ldls.cloud import Floats, Points, as_points
from ldls.errors import CalibrationError, LdlsError

ROTATION_LIMIT = 1e-3
"""Largest deviation of a rotation from orthonormal; calibration files round to 7 digits."""
ALONG_Z = 0.7
"""Share of z of the lidar along a camera's axis from which on it has no direction in the image."""
FARTHEST_CAMERA_M = 20.0
"""A camera farther from its lidar is hardly on the same rig: most translations that are in millimetres lead there."""


def as_transform(name: str, values: ArrayLike) -> Floats:
    """`values` as a (4, 4) matrix.

    Raises:
        CalibrationError: They are no such matrix.
    """
    if getattr(values, "shape", None) == (3, 4):
        raise CalibrationError(f"{name}: expected shape (4, 4), got (3, 4); add the row 0 0 0 1")
    return as_matrix(name, values, ((4, 4),))


def as_matrix(name: str, values: ArrayLike, shapes: tuple[tuple[int, ...], ...]) -> Floats:
    """`values` as a matrix of one of the shapes.

    Raises:
        CalibrationError: They are no such matrix; the message names the argument.
    """
    # a copy, which nobody else changes
    return numbers(name, values, np.float64, *shapes, error=CalibrationError).copy()


def rigid(place: str, matrix: Floats, error: type[LdlsError] = CalibrationError) -> Floats:
    """`matrix` (4, 4), which turns and shifts and does nothing else.

    Raises:
        CalibrationError: It does something else; the message has the deviation. Or another `error`.
    """
    if not np.isfinite(matrix).all():
        raise error(f"{place}: has numbers that are not finite, expected a rotation and metres")
    rotation = matrix[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are no rotation's
        deviation = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not deviation <= ROTATION_LIMIT:
        raise error(
            f"{place}: R^T R deviates by {deviation:.3g} from the identity, expected a rotation to {ROTATION_LIMIT}"
        )
    if not np.linalg.det(rotation) > 0:
        raise error(f"{place}: the determinant is -1, a mirror; expected a rotation")
    if matrix[3].tolist() != [0, 0, 0, 1]:
        raise error(f"{place}: the last row is {matrix[3].tolist()}, expected [0, 0, 0, 1]; transposed?")
    return matrix


def from_parts(rotation: Floats, translation: Floats | None = None) -> Floats:
    """The transform that turns by `rotation` (3, 3), then shifts by `translation` (3,) in metres."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = 0 if translation is None else translation
    return matrix


def doubt_of_distance(T_camera_lidar: Floats) -> str | None:
    """What is odd about the distance from lidar to camera; None where nothing is."""
    distance_m = float(np.linalg.norm(T_camera_lidar[:3, 3]))
    if not distance_m > FARTHEST_CAMERA_M:
        return None
    return (
        f"T_camera_lidar: the lidar is {distance_m:,.0f} m from the camera; is its translation in metres? Divide "
        "millimetres by 1000"
    )


def is_leaning(T_camera_lidar: Floats) -> bool:
    """True if z of the lidar points down or to the side in the image, by over 60 degrees.

    False where it lies along the camera's axis, and has no direction in the image.
    """
    x, y, z = T_camera_lidar[:3, 2]
    return bool(abs(z) < ALONG_Z and -y < 0.5 * np.hypot(x, y))


def inverse(matrix: Floats) -> Floats:
    """The transform back."""
    return from_parts(matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3])


def transformed(points: Points, matrix: Floats) -> Floats:
    """(N, 3) float64: x, y and z of `points` (N, >= 3), float32 or float64, after a transform (4, 4); metres."""
    return brought_together([points], [matrix], keep_origin=True)


def brought_together(clouds: Sequence[Points], matrices: Sequence[Floats], *, keep_origin: bool) -> Floats:
    """(N, 3) float64: the points of all clouds, one cloud after the other, each after its transform.

    Clouds are (n, >= 3) float32 or float64, matrices (4, 4); all in metres. Points at exactly (0, 0, 0) are missing
    returns and stay there, unless `keep_origin` is set. The core does it: after a product of matrices the threads of
    NumPy wait for more, for some 20 ms, on the cores that labels need next, and its last digits are the processor's.
    """
    each = [as_points(points) for points in clouds]
    return _ldls.brought_together(each, [matrix.tolist() for matrix in matrices], keep_origin)


def from_quaternion(place: str, quaternion: Floats, order: Literal["wxyz", "xyzw"] = "wxyz") -> Floats:
    """(3, 3) rotation of a quaternion in that order.

    Raises:
        CalibrationError: Its length is not 1.
    """
    with np.errstate(over="ignore"):  # of numbers that are no rotation's
        length = float(np.linalg.norm(quaternion))
    if not abs(length - 1) <= ROTATION_LIMIT:
        raise CalibrationError(
            f"{place}: quaternion {quaternion.tolist()} has length {length:.6g}, expected 1 ({' '.join(order)})"
        )
    w, x, y, z = np.roll(quaternion, -order.index("w")) / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def to_quaternion(rotation: Floats) -> Floats:
    """(4,) unit quaternion w x y z, w >= 0, of the rotation (3, 3): that of the nearest one, where digits are missing.

    It is the eigenvector of the largest eigenvalue of a symmetric matrix (Bar-Itzhack 2000), so half turns are no
    special case.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    quadratic = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    wxyz: Floats = np.linalg.eigh(quadratic).eigenvectors[:, -1]
    return -wxyz if wxyz[0] < 0 else wxyz
