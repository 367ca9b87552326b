"""KITTI calibration files: object, tracking and odometry."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import ParameterError
from ldls.io.kitti_lines import get_matrix, homogeneous, read_matrices

ARCHIVE = "data_object_calib"

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
    matrices = read_matrices(path, SIZES, SPELLINGS)
    projection = get_matrix(path, matrices, f"P{camera}", ARCHIVE).reshape(3, 4)
    if "Tr" in matrices and "Tr_velo_to_cam" not in matrices:
        return projection, homogeneous(matrices["Tr"].reshape(3, 4))
    velo_to_cam = homogeneous(get_matrix(path, matrices, "Tr_velo_to_cam", ARCHIVE).reshape(3, 4))
    rectification = homogeneous(get_matrix(path, matrices, "R0_rect", ARCHIVE).reshape(3, 3))
    return projection, rectification @ velo_to_cam
