"""Cameras as Rerun has them: an intrinsic matrix, and a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera

PIXEL_CENTRE = 0.5
"""Rerun's pixel centres lie at halves, ours at whole numbers."""


@dataclass(frozen=True, eq=False)
class Pinhole:
    """A pinhole camera in the lidar frame.

    Attributes:
        K: (3, 3) intrinsic matrix, upper triangular, of pixels whose centres lie at halves.
        T_lidar_camera: (4, 4) pose: rigid transform from camera (x right, y down, z forward) to lidar coordinates.
    """

    K: NDArray[np.float64]
    T_lidar_camera: NDArray[np.float64]


def pinhole_of(camera: Camera) -> Pinhole:
    """The pinhole with the projection of `camera`, exactly, where its lens is not distorted.

    The last column of a projection K [I | t], as of KITTI's P2, and a rotation in it go to the pose.
    """
    K, R = upper_triangular_times_rotation(camera.projection[:, :3])
    scale = K[2, 2]
    T_pinhole_camera = np.eye(4)
    T_pinhole_camera[:3, :3] = R
    T_pinhole_camera[:3, 3] = np.linalg.solve(K, camera.projection[:, 3])
    K /= scale
    K[:2] += PIXEL_CENTRE * K[2]
    return Pinhole(K, np.asarray(np.linalg.inv(T_pinhole_camera @ camera.T_camera_lidar), np.float64))


def upper_triangular_times_rotation(
    matrix: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K and R of K R = `matrix`, K upper triangular with a positive diagonal, R orthogonal (RQ decomposition)."""
    # numpy has QR only: turned about, a matrix's QR is its RQ
    Q, U = np.linalg.qr(matrix[::-1].T)
    K, R = U.T[::-1, ::-1], Q.T[::-1]
    signs = np.diag(np.where(np.diag(K) < 0, -1.0, 1.0))
    return K @ signs, signs @ R
