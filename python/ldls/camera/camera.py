"""The camera that took the image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.by_value import ByValue
from ldls.camera import camera_info
from ldls.camera.distortion import Distortion
from ldls.camera.fields import Fields
from ldls.camera.rigid import as_matrix, as_transform, from_parts, from_quaternion, inverse
from ldls.checks import as_image_size, checked_as, hold_python_values
from ldls.errors import CalibrationError, within


def _check_not_transposed(projection: NDArray[np.float64]) -> None:
    """Refuse the transpose of an intrinsic matrix, which has the principal point in its last row."""
    above = projection[[0, 0, 1], [1, 2, 2]]
    if not above.any() and not projection[:, 3:].any() and projection[2, :2].any():
        raise CalibrationError(
            f"projection: the last row is {projection[2].tolist()}, expected [0, 0, 1]; is K transposed? Pass K.T"
        )


def _depth_forward(projection: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of P and -P, which project alike, the one whose third row is the depth, positive before the camera.

    Where the extrinsic is in the projection the third row may point anywhere, and nothing tells -P from a mirror.
    """
    points_back = -projection[2, 2] > np.abs(projection[2, :2]).max()
    is_negated = points_back and np.linalg.slogdet(projection[:, :3])[0] < 0
    return -projection if is_negated else projection


def _taken_apart(projection: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K (3, 4) and the transform (4, 4) to the frame in which it is one, of a projection K [R | t]."""
    # numpy has QR only: turned about, a matrix's QR is its RQ
    Q, U = np.linalg.qr(projection[::-1, :3].T)
    intrinsic, rotation = np.triu(U.T[::-1, ::-1]), Q.T[::-1]
    signs = np.where(np.diag(intrinsic) < 0, -1.0, 1.0)
    # a mirror stays in K
    signs[0] *= np.sign(np.linalg.det(rotation)) * signs.prod()
    intrinsic, rotation = intrinsic * signs, signs[:, None] * rotation
    translation = np.linalg.solve(intrinsic, projection[:, 3])
    return np.column_stack([intrinsic, np.zeros(3)]), from_parts(rotation, translation)


def _pose(record: Fields) -> NDArray[np.float64]:
    """(4, 4) of a record of nuScenes' `calibrated_sensor` or `ego_pose`."""
    rotation = from_quaternion(f"{record.place}: rotation", record.matrix((4,), "rotation"))
    return from_parts(rotation, record.matrix((3,), "translation"))


@checked_as(CalibrationError)
@dataclass(frozen=True, eq=False, kw_only=True)
class Camera(ByValue):
    """A camera: a rigid transform from the lidar, the distortion of the lens if any, then a projection to pixels.

    Attributes:
        projection: (3, 4) from homogeneous points in the camera frame (metres; x right, y down, z forward) to
            homogeneous pixels; pixel centres lie at integer coordinates. A (3, 3) intrinsic matrix K is taken as
            [K | 0], -K, which projects alike, as its negative, and one that turns points,
            K [R | t] for points of the lidar, as K; its [R | t] then comes after `T_camera_lidar`, which holds both.
        T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates, column vectors.
        distortion: How the lens departs from a pinhole; nothing by default, as in rectified images. With one,
            `projection` is the intrinsic matrix K of the raw image.
        image_size: (height, width) of the image in pixels, if known; masks are then held against it.
        min_depth_m: Points at this depth or nearer are not in view, in metres.

    Raises:
        CalibrationError: A matrix has the wrong shape, is not finite, or cannot be a camera's.
    """

    core: _ldls.Camera = field(init=False, repr=False, compare=False)
    projection: NDArray[np.float64]
    T_camera_lidar: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    image_size: tuple[int, int] | None = None
    min_depth_m: float = 0.1
    distortion: Distortion = field(default_factory=Distortion)

    def __post_init__(self) -> None:
        hold_python_values(self)
        if getattr(self.projection, "shape", None) == (4, 4):
            raise CalibrationError(
                "projection: expected K (3, 3) or P (3, 4), got (4, 4); is it the extrinsic? Pass T_camera_lidar="
            )
        projection = as_matrix("projection", self.projection, ((3, 4), (3, 3)))
        _check_not_transposed(projection)
        if projection.shape == (3, 3):
            projection = np.hstack([projection, np.zeros((3, 1))])
        projection = _depth_forward(projection)
        transform = as_transform("T_camera_lidar", self.T_camera_lidar)
        self._hold(projection, transform)
        if self.image_size is not None:
            object.__setattr__(self, "image_size", as_image_size("image_size", self.image_size, CalibrationError))
        if not self.distortion.is_none and projection[:, 3].any():
            raise CalibrationError(
                f"projection: the last column is {projection[:, 3].tolist()}, expected zeros beside a distortion; pass "
                "the intrinsic matrix K of the raw image, or leave the distortion out for a rectified one"
            )
        # two axes turned round are half a turn; one is a mirror
        if np.tril(projection[:, :3], -1).any() or np.count_nonzero(np.diag(projection) < 0) == 2:
            # up, and how far away points are, go by the camera's own frame
            projection, extrinsic = _taken_apart(projection)
            self._hold(projection, extrinsic @ transform)

    def _hold(self, projection: NDArray[np.float64], transform: NDArray[np.float64]) -> None:
        """Be of these matrices, which the core checks."""
        for name, matrix in (("projection", projection), ("T_camera_lidar", transform)):
            matrix.flags.writeable = False
            object.__setattr__(self, name, matrix)
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
    @checked_as(CalibrationError)
    def from_opencv(
        cls,
        K: ArrayLike,
        D: ArrayLike = (),
        R: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        t: ArrayLike = (0, 0, 0),
        *,
        fisheye: bool = False,
        image_size: tuple[int, int] | None = None,
    ) -> Self:
        """Camera of the raw image from the matrices of OpenCV: x_camera = R x_lidar + t.

        Args:
            K: (3, 3) `cameraMatrix`, in pixels.
            D: `distCoeffs` of 4, 5, 8, 12 or 14 numbers, or the 4 of `cv2.fisheye`; none for a rectified image.
            R: (3, 3) rotation from lidar to camera coordinates; `cv2.Rodrigues` makes it of a rotation vector.
            t: (3,) translation from lidar to camera coordinates, in metres.
            fisheye: True if the coefficients are those of `cv2.fisheye`.
            image_size: (height, width) of the image in pixels, if known.

        Raises:
            CalibrationError: A matrix has the wrong shape, is not finite, or cannot be a camera's.
        """
        rotation, translation = as_matrix("R", R, ((3, 3),)), as_matrix("t", t, ((3,), (3, 1), (1, 3)))
        return cls(
            projection=as_matrix("K", K, ((3, 3),)),
            T_camera_lidar=from_parts(rotation, translation.ravel()),
            distortion=Distortion.from_opencv(D, fisheye=fisheye),
            image_size=image_size,
        )

    @classmethod
    @checked_as(CalibrationError)
    def from_camera_info(cls, message: object, T_camera_lidar: ArrayLike, *, rectified: bool = False) -> Self:
        """Camera of a CameraInfo message of ROS 1 or ROS 2, with its region of interest and binning.

        Args:
            message: The message, or a dict with the same names; `ldls.read_camera` reads files.
            T_camera_lidar: (4, 4) rigid transform from lidar coordinates to those of the camera as it is mounted, its
                frame_id.
            rectified: True if masks are of the rectified image, which takes P and R, instead of the raw one, which
                takes K and D.

        Raises:
            CalibrationError: The camera is not calibrated, or a field is missing or cannot be a camera's.
        """
        fields = camera_info.as_fields(message)
        arguments = camera_info.arguments(fields, as_transform("T_camera_lidar", T_camera_lidar), rectified=rectified)
        with within(fields.place):
            return cls(**arguments)

    @classmethod
    @checked_as(CalibrationError)
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

        T_camera_lidar = T_ego_camera^-1 T_global_ego(camera)^-1 T_global_ego(lidar) T_ego_lidar, of the records that
        https://www.nuscenes.org/nuscenes#data-format describes.

        Args:
            calibrated_camera: Record of `calibrated_sensor`: translation, rotation (w x y z) and camera_intrinsic.
            ego_pose_camera: Record of `ego_pose` of the image: translation and rotation.
            calibrated_lidar: Record of `calibrated_sensor` of the lidar.
            ego_pose_lidar: Record of `ego_pose` of the sweep.
            image_size: (height, width) of the image in pixels, if known.

        Raises:
            CalibrationError: A key is missing, or a value has the wrong size or is no rotation.
        """
        camera = Fields("calibrated_camera", calibrated_camera)
        from_ego = inverse(_pose(camera)) @ inverse(_pose(Fields("ego_pose_camera", ego_pose_camera)))
        to_ego = _pose(Fields("ego_pose_lidar", ego_pose_lidar)) @ _pose(Fields("calibrated_lidar", calibrated_lidar))
        projection = camera.matrix((3, 3), "camera_intrinsic", mend="is it the record of a lidar?")
        with within("calibrated_camera"):
            return cls(projection=projection, T_camera_lidar=from_ego @ to_ego, image_size=image_size)
