"""KITTI raw: the files calib_velo_to_cam.txt and calib_cam_to_cam.txt of a day."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CalibrationError, ParameterError
from ldls.io.cameras.found import FoundCamera
from ldls.io.kitti_lines import get_matrix, homogeneous, read_matrices

ARCHIVE = "the calibration of that day"
LIDAR_SIZES = {"R": 9, "T": 3}


def read(folder: str | PathLike[str], camera: int) -> FoundCamera:
    """The camera of the rectified images: u = P_rect R_rect_00 [R | T] x.

    Raises:
        CalibrationError: A key is missing or doubled, or a line does not hold the numbers it should.
        ParameterError: There is no such camera.
        FileNotFoundError: A file is missing.
    """
    if camera not in range(4):
        raise ParameterError(f"camera: got {camera!r}, expected 0 to 3")
    folder = Path(folder)
    lidar_path, camera_path = folder / "calib_velo_to_cam.txt", folder / "calib_cam_to_cam.txt"
    lidar = read_matrices(lidar_path, LIDAR_SIZES, {})
    p_rect, s_rect = f"P_rect_{camera:02}", f"S_rect_{camera:02}"
    cameras = read_matrices(camera_path, {p_rect: 12, "R_rect_00": 9, s_rect: 2}, {})
    rotation, translation = (get_matrix(lidar_path, lidar, key, ARCHIVE) for key in LIDAR_SIZES)
    to_camera = np.column_stack([rotation.reshape(3, 3), translation])
    projection, rectification = (get_matrix(camera_path, cameras, key, ARCHIVE) for key in (p_rect, "R_rect_00"))
    return FoundCamera(
        place=str(folder),
        projection=projection.reshape(3, 4),
        T_camera_lidar=homogeneous(rectification.reshape(3, 3)) @ homogeneous(to_camera),
        image_size=_image_size(camera_path, cameras.get(s_rect)),
    )


def _image_size(path: Path, width_height: NDArray[np.float64] | None) -> tuple[int, int] | None:
    if width_height is None:
        return None
    width, height = width_height
    if not (width >= 1 and height >= 1 and width % 1 == height % 1 == 0):
        raise CalibrationError(f"{path}: S_rect: expected width and height in pixels, got {width:g} and {height:g}")
    return int(height), int(width)
