"""Calibrations of OpenCV (FileStorage) and of ROS camera_calibration, in YAML.

Source: https://docs.opencv.org/4.x/da/d56/classcv_1_1FileStorage.html and
https://wiki.ros.org/camera_calibration_parsers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera, Distortion
from ldls.camera.fields import Fields
from ldls.errors import within

MATRIX = ("camera_matrix", "K", "cameraMatrix")
COEFFICIENTS = ("distortion_coefficients", "D", "distCoeffs", "dist_coeffs")


def camera_of(fields: Fields, *, T_camera_lidar: NDArray[np.float64], fisheye: bool = False) -> Camera:
    """Camera of the raw image.

    Args:
        fields: The file's entries.
        T_camera_lidar: (4, 4) from lidar to camera coordinates, which such files do not have.
        fisheye: Whether the coefficients are those of `cv2.fisheye`, where the file does not name their model.

    Raises:
        CalibrationError: A key is missing, or a value cannot be a camera's.
    """
    projection, distortion = fields.matrix((3, 3), *MATRIX), _distortion(fields, fisheye)
    image_size = fields.image_size()
    with within(fields.place):
        return Camera(
            projection=projection,
            T_camera_lidar=T_camera_lidar,
            distortion=distortion,
            image_size=image_size,
        )


def _distortion(fields: Fields, fisheye: bool) -> Distortion:
    coefficients = fields.numbers(*COEFFICIENTS, mend="write [] where there is no distortion")
    model = fields.find("distortion_model")
    if model is not None:
        return fields.distortion(str(model), coefficients)
    # Distortion takes eight or more coefficients for the rational model
    return fields.distortion("fisheye" if fisheye else "plumb_bob", coefficients)
