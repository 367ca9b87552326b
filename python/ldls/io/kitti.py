"""KITTI calibration files: object, tracking and odometry."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CalibrationError, ParameterError

SIZES = {"P0": 12, "P1": 12, "P2": 12, "P3": 12, "R0_rect": 9, "Tr_velo_to_cam": 12, "Tr": 12}
"""How many numbers each line holds that a camera needs."""
SPELLINGS = {"R_rect": "R0_rect", "R_rect_00": "R0_rect", "Tr_velo_cam": "Tr_velo_to_cam"}
"""How KITTI tracking spells the keys of KITTI object."""


def read_calibration(path: str | PathLike[str], *, camera: int = 2) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Projection (3, 4) and T_camera_lidar (4, 4) of a camera: u = P R0_rect Tr_velo_to_cam x.

    Odometry calibration has `Tr` for both of the latter.

    Raises:
        CalibrationError: A key is missing or doubled, or a line does not hold the numbers it should.
    """
    if camera not in range(4):
        raise ParameterError(f"camera: got {camera!r}, expected 0 to 3")
    path = Path(path)
    matrices = read_rows(path, SIZES)
    projection = _get(path, matrices, f"P{camera}").reshape(3, 4)
    if "Tr" in matrices and "Tr_velo_to_cam" not in matrices:
        return projection, homogeneous(matrices["Tr"].reshape(3, 4))
    velo_to_cam = homogeneous(_get(path, matrices, "Tr_velo_to_cam").reshape(3, 4))
    rectification = homogeneous(_get(path, matrices, "R0_rect").reshape(3, 3))
    return projection, rectification @ velo_to_cam


def read_rows(path: Path, sizes: Mapping[str, int]) -> dict[str, NDArray[np.float64]]:
    """The numbers of each line `key: numbers` whose key is one of `sizes`, which says how many there must be.

    Raises:
        CalibrationError: A key is doubled, or a line does not hold the numbers it should.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: not a text file ({error.reason} at {error.start})") from None
    matrices: dict[str, NDArray[np.float64]] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        key = words[0].rstrip(":") if words else ""
        key = key if key in sizes else SPELLINGS.get(key, key)
        if key not in sizes:
            continue
        if key in matrices:
            raise CalibrationError(f"{path}, line {number}: key '{words[0]}' stands there twice")
        matrices[key] = _numbers(f"{path}, line {number}", words[1:], sizes[key])
    return matrices


def _numbers(place: str, words: list[str], expected: int) -> NDArray[np.float64]:
    if len(words) != expected:
        raise CalibrationError(f"{place}: expected {expected} numbers, got {len(words)}")
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        raise CalibrationError(f"{place}: expected numbers with a decimal point, got {words}") from None
    if not np.isfinite(numbers).all():
        raise CalibrationError(f"{place}: expected finite numbers, got {words}")
    return numbers


def _get(path: Path, matrices: dict[str, NDArray[np.float64]], key: str) -> NDArray[np.float64]:
    if key not in matrices:
        found = " ".join(matrices) or "none"
        raise CalibrationError(f"{path}: key '{key}' missing; found {found}; did you unpack data_object_calib?")
    return matrices[key]


def homogeneous(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) transform of a (3, 3) rotation or a (3, 4) transform."""
    full = np.eye(4)
    full[:3, : matrix.shape[1]] = matrix
    return full
