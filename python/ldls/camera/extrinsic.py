"""Where the lidar is, seen from the camera, by the parts that drawings, robot descriptions and calibrations give."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.camera.rigid import as_matrix, from_parts, from_quaternion, inverse, rigid
from ldls.checks import checked_as
from ldls.errors import CalibrationError

OPTICAL_FROM_BODY = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""From x forward, y left, z up to x right, y down, z forward."""


@checked_as(CalibrationError)
def extrinsic(
    translation: ArrayLike,
    *,
    pose_of: Literal["camera", "lidar"],
    quaternion_wxyz: ArrayLike | None = None,
    quaternion_xyzw: ArrayLike | None = None,
    roll_pitch_yaw_deg: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    optical: bool = True,
) -> NDArray[np.float64]:
    """`T_camera_lidar`, (4, 4), from a translation and one of four ways to say a rotation.

    The pose of a frame in another one turns and shifts what has coordinates in the frame: x_other = R x + t. URDF,
    `/tf` and drawings of a vehicle give the pose of the camera in the lidar frame; OpenCV's R and t are the pose of the
    lidar in the camera frame.

    Args:
        translation: x, y, z in metres.
        pose_of: "camera": the pose of the camera in the lidar frame; "lidar": that of the lidar in the camera frame.
        quaternion_wxyz: Unit quaternion, w first (Eigen's constructor, nuScenes).
        quaternion_xyzw: Unit quaternion, w last (ROS, SciPy, TUM).
        roll_pitch_yaw_deg: Degrees about the fixed axes x, then y, then z (URDF).
        rotation: (3, 3) rotation matrix.
        optical: True if the camera's frame has x to the right, y down and z forward, as OpenCV's and ROS's optical
            frames; if not, x forward, y left and z up, as bodies in ROS, to which the turn is added.

    Raises:
        CalibrationError: There is no rotation or more than one, or one is none, or a value has another size.
    """
    ways = {
        "quaternion_wxyz": quaternion_wxyz,
        "quaternion_xyzw": quaternion_xyzw,
        "roll_pitch_yaw_deg": roll_pitch_yaw_deg,
        "rotation": rotation,
    }
    given = [name for name, value in ways.items() if value is not None]
    if len(given) != 1:
        raise CalibrationError(f"extrinsic: expected one of {', '.join(ways)}, got {', '.join(given) or 'none'}")
    (name,) = given
    turn = _rotation(name, np.asarray(ways[name]))
    pose = rigid(name, from_parts(turn, as_matrix("translation", translation, ((3,),))))
    from_lidar = inverse(pose) if pose_of == "camera" else pose
    return from_lidar if optical else OPTICAL_FROM_BODY @ from_lidar


def _rotation(name: str, value: NDArray[np.float64]) -> NDArray[np.float64]:
    if name == "rotation":
        return as_matrix(name, value, ((3, 3),))
    if name == "roll_pitch_yaw_deg":
        return turn_of(*np.radians(as_matrix(name, value, ((3,),))))
    quaternion = as_matrix(name, value, ((4,),))
    return from_quaternion(name, quaternion, "wxyz" if name == "quaternion_wxyz" else "xyzw")


def turn_of(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """(3, 3) rotation by so many radians about the fixed axes x, then y, then z."""
    return _about(2, yaw) @ _about(1, pitch) @ _about(0, roll)


def _about(axis: int, angle: float) -> NDArray[np.float64]:
    """The rotation about an axis that turns the next one towards the one after it."""
    turn = np.eye(3)
    one, other = (axis + 1) % 3, (axis + 2) % 3
    turn[one, one] = turn[other, other] = np.cos(angle)
    turn[other, one] = np.sin(angle)
    turn[one, other] = -turn[other, one]
    return turn
