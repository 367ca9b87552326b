"""Cameras from calibration files: the content tells the format."""

from __future__ import annotations

import re
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from ldls.camera import Camera
from ldls.camera.fields import Fields
from ldls.checks import checked, choice
from ldls.errors import CalibrationError, UnsupportedFormatError
from ldls.io.cameras import kalibr, kitti, opencv
from ldls.io.cameras.extrinsic_file import Extrinsic, as_extrinsic
from ldls.io.cameras.field_file import read_fields
from ldls.io.files import open_file
from ldls.io.options import check_options

READERS: dict[str, Callable[..., Camera]] = {
    "kitti": kitti.read,
    "kitti-raw": kitti.read_raw,
    "opencv": opencv.camera_of,
    "kalibr": kalibr.camera_of,
    "camera-info": Camera.from_camera_info,
}
"""Readers of cameras by format; those of names and values take these."""
FIELD_FORMATS = ("opencv", "kalibr", "camera-info")
KITTI_LINE = re.compile(r"(P[0-3]:|R0_rect|R_rect|Tr_velo|Tr:|Tr_imu)[^!]*$")
"""A line of KITTI's; a stereo calibration of OpenCV has `P1: !!opencv-matrix`."""
KALIBR_KEY = re.compile(r"cam\d+")
HEAD_BYTES = 4096


@checked
def read_camera(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    camera: int | str | None = None,
    T_camera_lidar: Extrinsic | None = None,
    T_imu_lidar: Extrinsic | None = None,
    fisheye: bool | None = None,
    rectified: bool | None = None,
    image_size: tuple[int, int] | None = None,
) -> Camera:
    """Camera of a calibration file.

    Args:
        path: KITTI object, tracking or odometry calibration; the folder of a day of KITTI raw; XML of OpenCV; or YAML
            (extra `yaml`) of OpenCV, of ROS camera_calibration, of Kalibr (a camera chain) or of a CameraInfo message.
        format: One of `READERS`, where the content does not tell.
        camera: Number of one of KITTI's cameras, 2 by default; key of one of Kalibr's, "cam0" by default; 1, which is
            the default, or 2 of a stereo pair of OpenCV.
        T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates, which "opencv" and "camera-info" lack,
            and "kalibr" where nothing leads to the lidar; of a CameraInfo, to the camera as it is mounted. Also a file
            of it: 12 or 16 numbers by rows, or YAML, JSON or TOML with the arguments of `ldls.extrinsic`; or such a
            table.
        T_imu_lidar: (4, 4) rigid transform from lidar to IMU coordinates, to go by the T_cam_imu of a "kalibr" file.
        fisheye: True if the coefficients of an "opencv" file are those of `cv2.fisheye`, where it names no model.
        rectified: True if masks are of the rectified image of a "camera-info", which takes P and R, instead of the raw
            one, which takes K and D.
        image_size: (height, width) of the image in pixels, where a "kitti" or "opencv" file does not say.

    Raises:
        CalibrationError: A key is missing or doubled, a value cannot be a camera's, or nothing leads to the lidar.
        UnsupportedFormatError: The content is of no known format.
        ParameterError: There is no such format, or it has no such option.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    if format is not None:
        choice("format", format, READERS)
    options: dict[str, Any] = {
        "camera": camera,
        "T_camera_lidar": None if T_camera_lidar is None else as_extrinsic(T_camera_lidar),
        "T_imu_lidar": None if T_imu_lidar is None else as_extrinsic(T_imu_lidar, "T_imu_lidar"),
        "fisheye": fisheye,
        "rectified": rectified,
        "image_size": image_size,
    }
    given = {name: value for name, value in options.items() if value is not None}
    source: Path | Fields = path
    if format in FIELD_FORMATS or (format is None and not is_kitti(path)):
        source = read_fields(path)
        format = format or _format_of(source, rectified=rectified)
    elif format is None:
        format = "kitti-raw" if path.is_dir() else "kitti"
    reader = READERS[format]
    check_options(f"{format} calibration ({path})", reader, given)
    if format in ("opencv", "camera-info") and T_camera_lidar is None:
        raise CalibrationError(
            f"{path}: does not say where the lidar is; pass its matrix, or a file of it, as T_camera_lidar="
        )
    return reader(source, **given)


def is_kitti(path: Path) -> bool:
    """True for a calibration file of KITTI, and the folder of a day of KITTI raw."""
    if path.is_dir():
        return True
    with open_file(path, "calibration", limit=kitti.MAX_BYTES) as file:
        lines = file.read(HEAD_BYTES).decode("utf-8-sig", "replace").splitlines()
    return path.suffix.lower() == ".txt" or any(KITTI_LINE.match(line) for line in lines)


def _format_of(entries: Fields, *, rectified: bool | None) -> str:
    if any(KALIBR_KEY.fullmatch(str(key)) for key in entries.entries):
        return "kalibr"
    if opencv.is_pair(entries):
        return "opencv"
    if entries.find(*opencv.MATRIX) is None:
        keys = " ".join(map(str, entries.entries)) or "none"
        raise UnsupportedFormatError(
            f"{entries.place}: no calibration that is known, found {keys}; expected camera_matrix or K, or cameras of "
            "Kalibr; format= says what it is"
        )
    message = rectified is not None or entries.find("roi", "binning_x", "header") is not None
    return "camera-info" if message else "opencv"
