"""TUM's format: `stamp tx ty tz qx qy qz qw` a line, in seconds and metres; # begins a comment."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ldls.camera.rigid import ROTATION_LIMIT, from_parts, from_quaternion, rigid, to_quaternion
from ldls.errors import CorruptFileError, within
from ldls.io.cameras.extrinsic_file import Extrinsic, as_extrinsic
from ldls.io.files import MAX_TEXT_BYTES, open_file, whole_file
from ldls.io.poses.pose_rows import check_ascending, read_pose_rows
from ldls.sequences import Trajectory

COLUMNS = "stamp tx ty tz qx qy qz qw"


def read(path: Path, *, T_camera_lidar: Extrinsic | None = None) -> Trajectory:
    """Trajectory of the lidar; with `T_camera_lidar` the file has poses of the camera instead.

    Raises:
        PoseError: A pose jumps.
        CalibrationError: `T_camera_lidar` is no rigid transform.
        FileFormatError: The file is broken; the message names the line.
    """
    from_lidar = np.eye(4) if T_camera_lidar is None else rigid("T_camera_lidar", as_extrinsic(T_camera_lidar))
    with open_file(path, "file of poses", limit=MAX_TEXT_BYTES) as file:
        lines, rows = read_pose_rows(file.text(), COLUMNS)
        check_ascending(lines, rows[:, 0].tolist())
        with np.errstate(over="ignore"):  # of numbers that are no rotation's
            lengths = np.linalg.norm(rows[:, 4:], axis=1)
        for number, length in zip(lines, lengths, strict=True):
            if not abs(length - 1) <= ROTATION_LIMIT:
                raise CorruptFileError(f"line {number}: quaternion qx qy qz qw has length {length:.6g}, expected 1")
    rotations = [from_quaternion(str(path), row[4:], "xyzw") for row in rows]
    poses = [from_parts(rotation, row[1:4]) for rotation, row in zip(rotations, rows, strict=True)]
    with within(path), np.errstate(over="ignore", invalid="ignore"):  # of coordinates that are none
        return Trajectory(rows[:, 0], np.array(poses) @ from_lidar)


def write(path: Path, trajectory: Trajectory, *, comment: str) -> None:
    """Write the poses of the lidar, to the last digit, after a line that says what they are."""
    lines = [f"# {comment}", f"# {COLUMNS}"]
    for stamp, pose in zip(trajectory.stamps.tolist(), trajectory.poses, strict=True):
        numbers = [stamp, *pose[:3, 3].tolist(), *np.roll(to_quaternion(pose[:3, :3]), -1).tolist()]
        lines.append(" ".join(map(repr, numbers)))
    with whole_file(path) as file:
        file.write("".join(f"{line}\n" for line in lines).encode())
