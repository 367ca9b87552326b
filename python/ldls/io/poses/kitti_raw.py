"""The `oxts` folder of a drive of KITTI raw: what its GPS and IMU measured for each frame.

data/NNNNNNNNNN.txt with 30 numbers: latitude and longitude in degrees, altitude in metres, roll, pitch and yaw in
radians first. timestamps.txt beside it, and calib_imu_to_velo.txt in the folder of the day. Poses are those of KITTI's
development kit.
"""

from __future__ import annotations

import errno
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera.extrinsic import turn_of
from ldls.camera.rigid import from_parts, inverse, rigid
from ldls.errors import CorruptFileError, UnsupportedFormatError, within
from ldls.io.cameras.kitti import read_raw_transform
from ldls.io.files import open_file
from ldls.io.kitti_stamps import CLOCK_EXAMPLE, clock_seconds, read_stamps
from ldls.io.names import is_hidden, name_order
from ldls.io.poses.pose_rows import check_ascending, read_pose_rows
from ldls.sequences import Trajectory

CALIBRATION = "calib_imu_to_velo.txt"
STAMPS = "timestamps.txt"
COLUMNS = (
    "lat lon alt roll pitch yaw vn ve vf vl vu ax ay az af al au wx wy wz wf wl wu pos_accuracy vel_accuracy navstat "
    "numsats posmode velmode orimode"
)
ANGLES = ("roll", "pitch", "yaw")
EARTH_RADIUS_M = 6_378_137.0
MAX_BYTES = 1 << 16


def read(path: Path) -> Trajectory:
    """Trajectory of the lidar, by the IMU's; x east, y north, z up, from where the IMU was at first.

    T_world_lidar = T_world_imu T_lidar_imu^-1. Positions are a Mercator projection, of the scale of the first latitude.

    Raises:
        UnsupportedFormatError: The folder has no data/*.txt.
        CalibrationError: The calibration of the day is broken.
        PoseError: A pose jumps.
        SourceError: There are fewer stamps than files.
        FileFormatError: A file is broken; the message names it.
        FileNotFoundError: The stamps, or the calibration of the day, are missing.
    """
    found = sorted((path / "data").glob("*.txt"), key=lambda file: name_order(file.name))
    files = {file.stem: file for file in found if not is_hidden(file.name)}
    if not files:
        raise UnsupportedFormatError(f"{path}: no folder of poses, expected KITTI's oxts with data/*.txt")
    calibration = path.absolute().parents[1] / CALIBRATION
    T_lidar_imu = rigid(str(calibration), read_raw_transform(calibration))
    if not (path / STAMPS).exists():
        raise FileNotFoundError(errno.ENOENT, "the times of the poses are missing", str(path / STAMPS))
    every = read_stamps(path / STAMPS, tuple(files), clock_seconds, example=CLOCK_EXAMPLE)
    stamps = {name: stamp for name, stamp in zip(files, every, strict=True) if stamp is not None}
    if not stamps:
        raise CorruptFileError(f"{path / STAMPS}: no stamp, expected lines such as {CLOCK_EXAMPLE}")
    with within(path / STAMPS):
        check_ascending([int(name) + 1 for name in stamps], list(stamps.values()))
    measured = np.array([_read_one(files[name]) for name in stamps])
    with within(path), np.errstate(over="ignore", invalid="ignore"):  # of coordinates that are none
        return Trajectory(np.array(list(stamps.values())), _poses_of_imu(measured) @ inverse(T_lidar_imu))


def _read_one(path: Path) -> NDArray[np.float64]:
    """(6,) latitude, longitude, altitude, roll, pitch, yaw."""
    with open_file(path, "measurement of KITTI's IMU", limit=MAX_BYTES) as file:
        # no digit of a position can be missing at the end of a line
        _, rows = read_pose_rows(f"{file.text()}\n", COLUMNS)
        if len(rows) > 1:
            raise CorruptFileError(f"{len(rows)} lines, expected one of {len(COLUMNS.split())} numbers")
        latitude, longitude = rows[0, :2]
        if not (abs(latitude) < 90 and abs(longitude) <= 180):
            raise CorruptFileError(f"line 1: latitude {latitude:g}, longitude {longitude:g}, expected degrees")
        angles = rows[0, 3:6]
        if not (np.abs(angles) <= 2 * np.pi).all():
            found = ", ".join(f"{name} {angle:g}" for name, angle in zip(ANGLES, angles, strict=True))
            raise CorruptFileError(f"line 1: {found}, expected radians, at most 2 pi; are they in degrees?")
    return rows[0, :6]


def _poses_of_imu(measured: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 4, 4) `T_world_imu`."""
    latitude, longitude, altitude, *angles = measured.T
    scaled_m = np.cos(np.radians(latitude[:1])) * EARTH_RADIUS_M
    east = scaled_m * np.radians(longitude)
    north = scaled_m * np.log(np.tan(np.pi / 4 + np.radians(latitude) / 2))
    places = np.stack([east, north, altitude], axis=1)
    turns = [turn_of(*each) for each in zip(*angles, strict=True)]
    return np.array([from_parts(turn, place) for turn, place in zip(turns, places - places[:1], strict=True)])
