"""Calibration of KITTI's raw drives: `calib_cam_to_cam.txt` and `calib_velo_to_cam.txt` in the folder of a day."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CalibrationError, ParameterError
from ldls.io.kitti import homogeneous, read_rows

CAMERAS_FILE, LIDAR_FILE = "calib_cam_to_cam.txt", "calib_velo_to_cam.txt"


def read_raw_calibration(
    folder: str | PathLike[str], *, camera: int = 2
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Projection (3, 4) and T_camera_lidar (4, 4) of a camera's rectified images: u = P_rect R_rect_00 (R | T) x.

    Args:
        folder: Folder of the day, as `2011_09_26`.
        camera: Number of the camera, 0 to 3.

    Raises:
        CalibrationError: A key is missing or doubled, or a line does not hold the numbers it should.
        FileNotFoundError: A file is missing.
    """
    number = _two_digits(camera)
    day = Path(folder)
    cameras = read_rows(day / CAMERAS_FILE, {f"P_rect_{number}": 12, "R_rect_00": 9})
    lidar = read_rows(day / LIDAR_FILE, {"R": 9, "T": 3})
    projection = _row(day / CAMERAS_FILE, cameras, f"P_rect_{number}").reshape(3, 4)
    rectification = homogeneous(_row(day / CAMERAS_FILE, cameras, "R_rect_00").reshape(3, 3))
    rotation = _row(day / LIDAR_FILE, lidar, "R").reshape(3, 3)
    translation = _row(day / LIDAR_FILE, lidar, "T").reshape(3, 1)
    return projection, rectification @ homogeneous(np.hstack([rotation, translation]))


def read_raw_image_size(folder: str | PathLike[str], *, camera: int = 2) -> tuple[int, int] | None:
    """(height, width) of a camera's rectified images in pixels, where the calibration says it.

    Raises:
        CalibrationError: The line does not hold two whole numbers from 1.
        FileNotFoundError: The file is missing.
    """
    path = Path(folder) / CAMERAS_FILE
    key = f"S_rect_{_two_digits(camera)}"
    size = read_rows(path, {key: 2}).get(key)
    if size is None:
        return None
    width, height = int(size[0]), int(size[1])
    if (width, height) != tuple(size) or min(width, height) < 1:
        raise CalibrationError(f"{path}: {key} is {size.tolist()}, expected width and height in pixels")
    return height, width


def _two_digits(camera: int) -> str:
    if camera not in range(4):
        raise ParameterError(f"camera: got {camera!r}, expected 0 to 3")
    return f"{camera:02d}"


def _row(path: Path, rows: dict[str, NDArray[np.float64]], key: str) -> NDArray[np.float64]:
    if key not in rows:
        raise CalibrationError(f"{path}: key '{key}' missing; did you unpack the calibration of this day?")
    return rows[key]
