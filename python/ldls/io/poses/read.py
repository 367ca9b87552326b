"""Poses of a drive from files: the content tells the format."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from ldls.checks import checked, choice
from ldls.errors import TruncatedFileError, UnsupportedFormatError
from ldls.io.cameras.extrinsic_file import Extrinsic
from ldls.io.files import MAX_TEXT_BYTES, open_file
from ldls.io.options import check_options
from ldls.io.poses import kitti, kitti_raw, tum
from ldls.io.poses.pose_rows import pose_rows
from ldls.sequences import Trajectory

READERS: dict[str, Callable[..., Trajectory]] = {"kitti": kitti.read, "tum": tum.read, "kitti-raw": kitti_raw.read}
"""Readers of poses by format."""
BY_COLUMNS = {len(kitti.COLUMNS.split()): "kitti", len(tum.COLUMNS.split()): "tum"}
"""Formats by the numbers that a line has."""


@checked
def read_poses(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    stamps: ArrayLike | None = None,
    T_camera_lidar: Extrinsic | None = None,
) -> Trajectory:
    """Trajectory of the lidar over a drive.

    Poses of a "tum" file keep its world, whose z is to be up for tracks and maps: that of visual SLAM is the frame of
    its first camera, that of others north, east and down. Poses multiplied from the left by the inverse of the first of
    them are in the lidar's frame at first.

    Args:
        path: KITTI's `poses.txt` (12 numbers a line: the pose of camera 0 in its first frame), a file in TUM's format
            (`stamp tx ty tz qx qy qz qw` a line), or the folder `oxts` of a drive of KITTI raw, with
            calib_imu_to_velo.txt in the folder of the day.
        format: One of `READERS`, where the content does not tell.
        stamps: (n,) times of the poses in seconds, which a "kitti" file lacks: those of its times.txt.
        T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates, or a file of it: of a "kitti" file to
            camera 0; of a "tum" file to the camera whose poses it has, where they are not the lidar's own.

    Raises:
        TruncatedFileError: A file is empty or ends too early.
        CorruptFileError: A line has another number of numbers, one that is none or not finite, no rotation, or a stamp
            that is not later than the one before; the message names it.
        UnsupportedFormatError: The content is of no known format.
        PoseError: A "kitti" file lacks stamps or transform, there is not one stamp a pose, stamps are not in
            seconds, or the lidar jumps.
        CalibrationError: `T_camera_lidar`, or a calibration of KITTI raw, is no rigid transform.
        ParameterError: There is no such format, or it has no such option.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    options: dict[str, Any] = {"stamps": stamps, "T_camera_lidar": T_camera_lidar}
    given = {name: value for name, value in options.items() if value is not None}
    format = format_of(path) if format is None else choice("format", format, READERS)
    check_options(f"{format} poses ({path})", READERS[format], given)
    return READERS[format](path, **given)


def format_of(path: Path) -> str:
    """The format of a file of poses, by its content; errors as of `read_poses`."""
    if path.is_dir():
        return "kitti-raw"
    with open_file(path, "file of poses", limit=MAX_TEXT_BYTES) as file:
        rows = pose_rows(file.text())
        if not rows:
            raise TruncatedFileError("no pose, expected 12 numbers a line (KITTI) or 8 (TUM)")
        number, line = rows[0]
        n_columns = len(line.split())
        if n_columns not in BY_COLUMNS:
            mend = "leave out the last four of each line, 0 0 0 1, if they are matrices of KITTI's poses"
            raise UnsupportedFormatError(
                f"line {number}: {n_columns} numbers, expected 12 of a KITTI pose, or 8 of TUM's ({tum.COLUMNS}), "
                f"separated by blanks; {mend if n_columns == 16 else 'format= says what it is'}"
            )
    return BY_COLUMNS[n_columns]
