"""The camera that took the image."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls import _ldls
from ldls.distortion import Distortion
from ldls.errors import CalibrationError
from ldls.io import kitti


def _identity() -> NDArray[np.float64]:
    return np.eye(4)


@dataclass(frozen=True, eq=False, kw_only=True)
class Camera:
    """A camera: a rigid transform from the lidar, the distortion of the lens if any, then a projection to pixels.

    Attributes:
        projection: (3, 4) from homogeneous points in the camera frame (metres; x right, y down, z forward) to
            homogeneous pixels; pixel centres lie at integer coordinates. A (3, 3) intrinsic matrix K is taken as
            [K | 0].
        T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates, column vectors.
        distortion: How the lens departs from a pinhole; nothing by default, as in rectified images. With one,
            `projection` is the intrinsic matrix K of the raw image.
        image_size: (height, width) of the image in pixels, if known; masks are then held against it.
        min_depth_m: Points at this depth or nearer are not in view, in metres.

    Raises:
        CalibrationError: A matrix has the wrong shape, is not finite, or cannot be a camera's.
    """

    core: _ldls.Camera = field(init=False, repr=False)
    projection: NDArray[np.float64]
    T_camera_lidar: NDArray[np.float64] = field(default_factory=_identity)
    image_size: tuple[int, int] | None = None
    min_depth_m: float = 0.1
    distortion: Distortion = field(default_factory=Distortion)

    def __post_init__(self) -> None:
        projection = _matrix("projection", self.projection, ((3, 4), (3, 3)))
        if projection.shape == (3, 3):
            projection = np.hstack([projection, np.zeros((3, 1))])
        transform = _matrix("T_camera_lidar", self.T_camera_lidar, ((4, 4),))
        for name, matrix in (("projection", projection), ("T_camera_lidar", transform)):
            matrix.flags.writeable = False
            object.__setattr__(self, name, matrix)
        if not self.distortion.is_none and projection[:, 3].any():
            raise CalibrationError(
                f"projection: the last column is {projection[:, 3].tolist()}, expected zeros beside a distortion; pass "
                "the intrinsic matrix K of the raw image, or leave the distortion out for a rectified one"
            )
        object.__setattr__(self, "core", self._core())

    def _core(self) -> _ldls.Camera:
        return _ldls.Camera(
            self.projection,
            self.T_camera_lidar,
            float(self.min_depth_m),
            *self.distortion.as_core(),
        )

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name != "core"}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        object.__setattr__(self, "core", self._core())

    @classmethod
    def from_kitti(
        cls,
        path: str | PathLike[str],
        *,
        camera: int = 2,
        image_size: tuple[int, int] | None = None,
    ) -> Self:
        """Camera of a KITTI object, tracking or odometry calibration file.

        Args:
            path: Calibration with the lines P0 to P3, R0_rect and Tr_velo_to_cam (or R_rect, Tr_velo_cam, Tr).
            camera: Number of the camera, 0 to 3; 2 is the left colour camera.
            image_size: (height, width) of the image in pixels, if known.

        Raises:
            CalibrationError: A key is missing or doubled, or a line has too few or too many numbers.
            FileNotFoundError: There is no such file.
        """
        projection, transform = kitti.read_calibration(path, camera=camera)
        try:
            return cls(projection=projection, T_camera_lidar=transform, image_size=image_size)
        except CalibrationError as error:
            raise CalibrationError(f"{path}: {error}") from None


def _matrix(name: str, values: ArrayLike, shapes: tuple[tuple[int, int], ...]) -> NDArray[np.float64]:
    try:
        matrix = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise CalibrationError(f"{name}: expected an array of numbers") from None
    if matrix.shape not in shapes:
        expected = " or ".join(map(str, shapes))
        raise CalibrationError(f"{name}: expected shape {expected}, got {matrix.shape}")
    return matrix
