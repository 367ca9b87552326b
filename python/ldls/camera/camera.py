"""The camera that took the image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls import _ldls
from ldls.camera.distortion import Distortion
from ldls.errors import CalibrationError
from ldls.io import kitti
from ldls.io.cameras import camera_info, kalibr, kitti_raw, nuscenes, opencv_yaml
from ldls.io.cameras.found import FoundCamera


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
        transform = _transform("T_camera_lidar", self.T_camera_lidar)
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
        found = FoundCamera(place=str(path), projection=projection, T_camera_lidar=transform, image_size=image_size)
        return cls.of_found(found)

    @classmethod
    def from_kitti_raw(cls, folder: str | PathLike[str], *, camera: int = 2) -> Self:
        """Camera of the rectified images of a day of KITTI raw.

        Args:
            folder: Folder of a day, with calib_velo_to_cam.txt and calib_cam_to_cam.txt.
            camera: Number of the camera, 0 to 3; 2 is the left colour camera.

        Raises:
            CalibrationError: A key is missing or doubled, or a line has too few or too many numbers.
            FileNotFoundError: A file is missing.
        """
        return cls.of_found(kitti_raw.read(folder, camera))

    @classmethod
    def from_opencv(cls, path: str | PathLike[str], T_camera_lidar: ArrayLike, *, fisheye: bool = False) -> Self:
        """Camera of the raw image, from a YAML file of OpenCV or of ROS camera_calibration.

        Args:
            path: File with camera_matrix (or K) and distortion_coefficients (or D), and, where it has them,
                distortion_model, image_width and image_height. Needs the extra `yaml`.
            T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates, which such files do not have.
            fisheye: Whether the coefficients are those of `cv2.fisheye`, where the file does not name their model.

        Raises:
            CalibrationError: It is not YAML, a key is missing, or a value cannot be a camera's.
            FileNotFoundError: There is no such file.
        """
        return cls.of_found(opencv_yaml.read(path, _transform("T_camera_lidar", T_camera_lidar), fisheye=fisheye))

    @classmethod
    def from_kalibr(
        cls,
        path: str | PathLike[str],
        *,
        camera: str = "cam0",
        T_camera_lidar: ArrayLike | None = None,
        T_imu_lidar: ArrayLike | None = None,
    ) -> Self:
        """Camera of the raw image, from a camera chain of Kalibr; a pinhole with radtan, equidistant or no distortion.

        Args:
            path: The chain, YAML. Needs the extra `yaml`.
            camera: Key of the camera.
            T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates; without it the file must have
                T_cam_lidar at this camera or at one before it in the chain (T_cn_cnm1).
            T_imu_lidar: (4, 4) rigid transform from lidar to IMU coordinates, to go by the file's T_cam_imu instead.

        Raises:
            CalibrationError: It is not YAML, a key is missing, the camera is no pinhole, or nothing leads to the lidar.
            FileNotFoundError: There is no such file.
        """
        to_camera = None if T_camera_lidar is None else _transform("T_camera_lidar", T_camera_lidar)
        to_imu = None if T_imu_lidar is None else _transform("T_imu_lidar", T_imu_lidar)
        return cls.of_found(kalibr.read(path, camera, to_camera, to_imu))

    @classmethod
    def from_camera_info(cls, message: object, T_camera_lidar: ArrayLike, *, rectified: bool = False) -> Self:
        """Camera of a CameraInfo message of ROS 1 or ROS 2, with its region of interest and binning.

        Args:
            message: The message, a dict with the same names, or the path of a YAML file (extra `yaml`).
            T_camera_lidar: (4, 4) rigid transform from lidar coordinates to those of the camera as it is mounted, its
                frame_id.
            rectified: Whether masks are of the rectified image, which takes P and R, instead of the raw one, which
                takes K and D.

        Raises:
            CalibrationError: The camera is not calibrated, or a field is missing or cannot be a camera's.
        """
        return cls.of_found(
            camera_info.read(message, _transform("T_camera_lidar", T_camera_lidar), rectified=rectified)
        )

    @classmethod
    def from_nuscenes(
        cls,
        calibrated_camera: Mapping[str, Any],
        ego_pose_camera: Mapping[str, Any],
        calibrated_lidar: Mapping[str, Any],
        ego_pose_lidar: Mapping[str, Any],
        *,
        image_size: tuple[int, int] | None = None,
    ) -> Self:
        """Camera at the moment of its image, seen from the lidar at the moment of its sweep.

        Args:
            calibrated_camera: Record of `calibrated_sensor`: translation, rotation (w x y z) and camera_intrinsic.
            ego_pose_camera: Record of `ego_pose` of the image: translation and rotation.
            calibrated_lidar: Record of `calibrated_sensor` of the lidar.
            ego_pose_lidar: Record of `ego_pose` of the sweep.
            image_size: (height, width) of the image in pixels, if known.

        Raises:
            CalibrationError: A key is missing, or a value has the wrong size or is no rotation.
        """
        records = (calibrated_camera, ego_pose_camera, calibrated_lidar, ego_pose_lidar)
        return cls.of_found(nuscenes.read(*records, image_size))

    @classmethod
    def of_found(cls, found: FoundCamera) -> Self:
        """Camera of what a reader of calibrations found.

        Raises:
            CalibrationError: It cannot be a camera; the message begins with the file.
        """
        try:
            return cls(
                projection=found.projection,
                T_camera_lidar=found.T_camera_lidar,
                distortion=found.distortion,
                image_size=found.image_size,
                min_depth_m=found.min_depth_m,
            )
        except CalibrationError as error:
            raise CalibrationError(f"{found.place}: {error}") from None


def _transform(name: str, values: ArrayLike) -> NDArray[np.float64]:
    return _matrix(name, values, ((4, 4),))


def _matrix(name: str, values: ArrayLike, shapes: tuple[tuple[int, int], ...]) -> NDArray[np.float64]:
    try:
        matrix = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise CalibrationError(f"{name}: expected an array of numbers") from None
    if matrix.shape not in shapes:
        expected = " or ".join(map(str, shapes))
        raise CalibrationError(f"{name}: expected shape {expected}, got {matrix.shape}")
    return matrix
