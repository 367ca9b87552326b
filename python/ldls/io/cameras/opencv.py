"""Calibrations of OpenCV (FileStorage, of one camera or of a stereo pair) and of ROS camera_calibration.

Source: https://docs.opencv.org/4.x/da/d56/classcv_1_1FileStorage.html and
https://wiki.ros.org/camera_calibration_parsers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera, Distortion
from ldls.camera.fields import Fields
from ldls.errors import CalibrationError, ParameterError, within

MATRIX = ("camera_matrix", "K", "cameraMatrix")
COEFFICIENTS = ("distortion_coefficients", "D", "distCoeffs", "dist_coeffs", "dist_coeff")
PAIR = ("M", "cameraMatrix", "camera_matrix"), ("D", "distCoeffs", "dist_coeffs", "distortion_coefficients")
"""Keys of the matrices and of the coefficients of a pair, before the number of the camera."""


def camera_of(
    fields: Fields,
    *,
    T_camera_lidar: NDArray[np.float64],
    camera: int | None = None,
    fisheye: bool | None = None,
    image_size: tuple[int, int] | None = None,
) -> Camera:
    """Camera of the raw image.

    Args:
        fields: The file's entries.
        T_camera_lidar: (4, 4) from lidar to camera coordinates, which such files do not have.
        camera: Which of a stereo pair, 1 or 2; 1 by default.
        fisheye: True if the coefficients are those of `cv2.fisheye`, where the file does not name their model.
        image_size: (height, width) in pixels, where the file does not say.

    Raises:
        CalibrationError: A key is missing, or a value cannot be a camera's, or the file has another `image_size`.
    """
    matrix: tuple[str, ...] = MATRIX
    coefficients: tuple[str, ...] = COEFFICIENTS
    if is_pair(fields):
        if camera not in (None, 1, 2):
            raise ParameterError(f"camera: got {camera!r}, expected 1 or 2, of the pair in {fields.place}")
        matrix, coefficients = [tuple(f"{key}{camera or 1}" for key in keys) for keys in PAIR]
    elif camera is not None:
        raise ParameterError(f"camera: got {camera!r}, but {fields.place} is of one camera; leave it out")
    projection, distortion = fields.matrix((3, 3), *matrix), _distortion(fields, coefficients, fisheye)
    own_size = fields.image_size()
    with within(fields.place):
        if own_size is not None and image_size is not None and tuple(image_size) != own_size:
            raise CalibrationError(f"image_size: got {tuple(image_size)}, the file says {own_size}; leave it out")
        return Camera(
            projection=projection,
            T_camera_lidar=T_camera_lidar,
            distortion=distortion,
            image_size=own_size or image_size,
        )


def is_pair(fields: Fields) -> bool:
    """True for the two cameras of a stereo calibration."""
    return any(fields.find(f"{key}1") is not None for key in PAIR[0])


def _distortion(fields: Fields, keys: tuple[str, ...], fisheye: bool | None) -> Distortion:
    coefficients = fields.numbers(*keys, mend="write [] where there is no distortion")
    model = fields.find("distortion_model")
    if model is not None:
        return fields.distortion(str(model), coefficients)
    # the sample program of OpenCV says so
    fisheye = bool(fields.whole_number("fisheye_model")) if fisheye is None else fisheye
    # Distortion takes eight or more coefficients for the rational model
    return fields.distortion("fisheye" if fisheye else "plumb_bob", coefficients)
