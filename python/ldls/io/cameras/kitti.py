"""KITTI's calibration files: object, tracking and odometry, and the days of KITTI raw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.camera.rigid import from_parts
from ldls.checks.values import number_of
from ldls.errors import CalibrationError, ParameterError, within
from ldls.io.files import read_lines

MAX_BYTES = 1 << 20
OBJECT_ARCHIVE = "data_object_calib"
RAW_ARCHIVE = "the calibration of that day"
RAW_FILES = ("calib_velo_to_cam.txt", "calib_cam_to_cam.txt")
"""Where the lidar is, and the cameras of a day of KITTI raw."""
SIZES = {"P0": 12, "P1": 12, "P2": 12, "P3": 12, "R0_rect": 9, "Tr_velo_to_cam": 12, "Tr": 12}
"""Numbers in each line that a camera needs."""
SPELLINGS = {"R_rect": "R0_rect", "R_rect_00": "R0_rect", "Tr_velo_cam": "Tr_velo_to_cam"}
"""Keys of KITTI tracking, and those of KITTI object that they stand for."""
TRANSFORM_SIZES = {"R": 9, "T": 3}

Matrices = dict[str, NDArray[np.float64]]


def camera_numbers(camera: int | Sequence[int], *, digits: int = 1) -> dict[str, int]:
    """The numbers of one camera or several, by the folder of its images: 0 and 1 are grey, 2 and 3 in colour.

    Args:
        camera: The numbers.
        digits: How many a folder's name has: 1 as image_2, in KITTI's raw data 2, as image_02.

    Raises:
        ParameterError: There is none, one stands there twice, or one is not 0 to 3.
    """
    numbers = (camera,) if isinstance(camera, int) else tuple(camera)
    if not numbers or len(set(numbers)) != len(numbers) or not set(numbers) <= set(range(4)):
        raise ParameterError(f"camera: got {camera!r}, expected a number from 0 to 3, or several different ones")
    return {f"image_{number:0{digits}}": number for number in numbers}


def read(path: str | PathLike[str], *, camera: int = 2, image_size: tuple[int, int] | None = None) -> Camera:
    """Camera of a KITTI object, tracking or odometry file: u = P R0_rect Tr_velo_to_cam x.

    Args:
        path: Calibration with the lines P0 to P3, R0_rect and Tr_velo_to_cam (or R_rect, Tr_velo_cam); odometry has
            Tr for both of the latter.
        camera: Number of the camera, 0 to 3; 2 is the left colour camera.
        image_size: (height, width) of the image in pixels, if known.

    Raises:
        CalibrationError: A key is missing or doubled, or a line does not hold the numbers it should.
        FileNotFoundError: There is no such file.
    """
    _check_number(camera)
    path = Path(path)
    matrices = _read_matrices(path, SIZES, SPELLINGS)
    if f"P{camera}" not in matrices and path.name in RAW_FILES:
        raise CalibrationError(f"{path}: half a calibration of KITTI raw; pass the folder of the day, {path.parent}")
    projection = _get_matrix(path, matrices, f"P{camera}", OBJECT_ARCHIVE).reshape(3, 4)
    key = "Tr" if "Tr" in matrices and "Tr_velo_to_cam" not in matrices else "Tr_velo_to_cam"
    to_camera = _get_matrix(path, matrices, key, OBJECT_ARCHIVE).reshape(3, 4)
    T_camera_lidar = from_parts(to_camera[:, :3], to_camera[:, 3])
    if key != "Tr":
        T_camera_lidar = _turned(_get_matrix(path, matrices, "R0_rect", OBJECT_ARCHIVE), T_camera_lidar)
    with within(path):
        return Camera(projection=projection, T_camera_lidar=T_camera_lidar, image_size=image_size)


def _turned(rotation: NDArray[np.float64], transform: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) a transform followed by a rotation, of nine numbers."""
    with np.errstate(over="ignore", invalid="ignore"):  # the camera refuses what is then not finite
        return from_parts(rotation.reshape(3, 3)) @ transform


def read_raw(folder: str | PathLike[str], *, camera: int = 2) -> Camera:
    """Camera of the rectified images of a day of KITTI raw: u = P_rect R_rect_00 [R | T] x.

    Args:
        folder: Folder of a day, with calib_velo_to_cam.txt and calib_cam_to_cam.txt.
        camera: Number of the camera, 0 to 3; 2 is the left colour camera.

    Raises:
        CalibrationError: A key is missing or doubled, or a line does not hold the numbers it should.
        FileNotFoundError: A file is missing.
    """
    _check_number(camera)
    folder = Path(folder)
    lidar_path, camera_path = (folder / name for name in RAW_FILES)
    p_rect, s_rect = f"P_rect_{camera:02}", f"S_rect_{camera:02}"
    cameras = _read_matrices(camera_path, {p_rect: 12, "R_rect_00": 9, s_rect: 2}, {})
    to_camera = read_raw_transform(lidar_path)
    projection, rectification = (_get_matrix(camera_path, cameras, key, RAW_ARCHIVE) for key in (p_rect, "R_rect_00"))
    size = _image_size(camera_path, cameras.get(s_rect))
    with within(folder):
        return Camera(
            projection=projection.reshape(3, 4),
            T_camera_lidar=_turned(rectification, to_camera),
            image_size=size,
        )


def read_raw_transform(path: Path) -> NDArray[np.float64]:
    """(4, 4) of a file of a day of KITTI raw with the lines R and T, as calib_velo_to_cam.txt.

    Raises:
        CalibrationError: A key is missing or doubled, or a line does not hold the numbers it should.
        FileNotFoundError: The file is missing.
    """
    matrices = _read_matrices(path, TRANSFORM_SIZES, {})
    rotation, translation = (_get_matrix(path, matrices, key, RAW_ARCHIVE) for key in TRANSFORM_SIZES)
    return from_parts(rotation.reshape(3, 3), translation)


def _check_number(camera: int) -> None:
    if camera not in range(4):
        raise ParameterError(f"camera: got {camera!r}, expected 0 to 3")


def _image_size(path: Path, width_height: NDArray[np.float64] | None) -> tuple[int, int] | None:
    if width_height is None:
        return None
    width, height = width_height
    if not (width >= 1 and height >= 1 and width % 1 == height % 1 == 0):
        raise CalibrationError(f"{path}: S_rect: expected width and height in pixels, got {width:g} and {height:g}")
    return int(height), int(width)


def _read_matrices(path: Path, sizes: Mapping[str, int], spellings: Mapping[str, str]) -> Matrices:
    """The numbers of each line whose key is in `sizes`, which says how many there are, by that key.

    Args:
        path: The file.
        sizes: How many numbers each line holds that is wanted.
        spellings: Other keys for some of them.

    Raises:
        CalibrationError: A key is doubled, or a line does not hold the numbers it should.
    """
    matrices: Matrices = {}
    for number, line in enumerate(read_lines(path, "calibration", limit=MAX_BYTES), start=1):
        words = line.partition("#")[0].split()
        key = spellings.get(words[0].rstrip(":"), words[0].rstrip(":")) if words else ""
        if key not in sizes:
            continue
        if key in matrices:
            raise CalibrationError(f"{path}, line {number}: key '{words[0]}' stands there twice")
        matrices[key] = _numbers(f"{path}, line {number}", words[1:], sizes[key])
    return matrices


def _get_matrix(path: Path, matrices: Matrices, key: str, archive: str) -> NDArray[np.float64]:
    """The numbers under `key`.

    Raises:
        CalibrationError: There are none; the message asks whether `archive` was unpacked.
    """
    if key not in matrices:
        found = " ".join(matrices) or "none"
        raise CalibrationError(f"{path}: key '{key}' missing; found {found}; did you unpack {archive}?")
    return matrices[key]


def _numbers(place: str, words: list[str], expected: int) -> NDArray[np.float64]:
    if len(words) != expected:
        raise CalibrationError(f"{place}: expected {expected} numbers, got {len(words)}")
    try:
        numbers = np.array([number_of(word) for word in words])
    except ValueError:
        raise CalibrationError(f"{place}: expected numbers with a decimal point, got {words}") from None
    if not np.isfinite(numbers).all():
        raise CalibrationError(f"{place}: expected finite numbers, got {words}")
    return numbers
