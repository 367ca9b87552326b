"""KITTI's `poses.txt`: 12 numbers a line, the pose of camera 0 in its own first frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ldls.camera.rigid import inverse, rigid
from ldls.checks import numbers
from ldls.errors import CorruptFileError, PoseError, within
from ldls.io.cameras.extrinsic_file import Extrinsic, as_extrinsic
from ldls.io.files import MAX_TEXT_BYTES, open_file
from ldls.io.poses.pose_rows import read_pose_rows
from ldls.sequences import Trajectory

COLUMNS = "r11 r12 r13 tx r21 r22 r23 ty r31 r32 r33 tz"


def read(
    path: Path,
    *,
    stamps: ArrayLike | None = None,
    T_camera_lidar: Extrinsic | None = None,
    chosen: Sequence[int] | slice = slice(None),
) -> Trajectory:
    """Trajectory of the lidar, whose first pose is that of the world.

    A line is the pose P of camera 0, and T_world_lidar = T_camera_lidar^-1 P T_camera_lidar. Stamps are those of the
    `chosen` poses, by their number in the file.

    Raises:
        PoseError: Stamps or transform are not given, are not of these poses, or a pose jumps.
        CalibrationError: `T_camera_lidar` is no rigid transform.
        FileFormatError: The file is broken; the message names the line.
    """
    if stamps is None or T_camera_lidar is None:
        missing = "stamps" if T_camera_lidar is not None else "T_camera_lidar" if stamps is not None else "both"
        raise PoseError(
            f"{path}: KITTI's poses are those of camera 0, without times; pass stamps=, the numbers of times.txt, and "
            f"T_camera_lidar=, that of ldls.read_camera('calib.txt'); got no {missing.replace('both', 'such')}"
        )
    from_lidar = rigid("T_camera_lidar", as_extrinsic(T_camera_lidar))
    with open_file(path, "file of poses", limit=MAX_TEXT_BYTES) as file:
        lines, rows = read_pose_rows(file.text(), COLUMNS)
        poses = np.tile(np.eye(4), (len(rows), 1, 1))
        poses[:, :3] = rows.reshape(-1, 3, 4)
        for number, pose in zip(lines, poses, strict=True):
            rigid(f"line {number}", pose, CorruptFileError)
    poses, lines_of = poses[chosen], np.array(lines)[chosen]
    times = numbers("stamps", stamps, np.float64, ("n",))
    if len(times) != len(poses):
        raise PoseError(
            f"{path}: has {len(poses)} poses for {len(times)} stamps, expected a line for each sweep of the drive"
        )
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        at = int(back[0])
        raise PoseError(
            f"{path}: line {lines_of[at]} is the pose at {times[at]:.6f} s, and line {lines_of[at + 1]} that at "
            f"{times[at + 1]:.6f} s, "
            "expected ascending times; mend these, which stand in another file"
        )
    with within(path), np.errstate(over="ignore", invalid="ignore"):  # of coordinates that are none
        return Trajectory(times, inverse(from_lidar) @ poses @ from_lidar)
