"""Calibrations of OpenCV (FileStorage) and of ROS camera_calibration, in YAML.

Source: https://docs.opencv.org/4.x/da/d56/classcv_1_1FileStorage.html and
https://wiki.ros.org/camera_calibration_parsers.
"""

from __future__ import annotations

from os import PathLike

import numpy as np
from numpy.typing import NDArray

from ldls.camera.distortion import Distortion
from ldls.io.cameras.fields import Fields
from ldls.io.cameras.found import FoundCamera
from ldls.io.cameras.yaml_file import read_yaml

MATRIX = ("camera_matrix", "K", "cameraMatrix")
COEFFICIENTS = ("distortion_coefficients", "D", "distCoeffs", "dist_coeffs")
WIDTH = ("image_width", "width")
HEIGHT = ("image_height", "height")


def read(path: str | PathLike[str], T_camera_lidar: NDArray[np.float64], *, fisheye: bool) -> FoundCamera:
    """The camera of the raw image.

    Args:
        path: The file.
        T_camera_lidar: (4, 4) from lidar to camera coordinates, which such files do not have.
        fisheye: Whether the coefficients are those of `cv2.fisheye`, where the file does not name their model.

    Raises:
        CalibrationError: It is not YAML, a key is missing, or a value cannot be a camera's.
    """
    fields = read_yaml(path)
    return FoundCamera(
        place=fields.place,
        projection=fields.matrix((3, 3), *MATRIX),
        T_camera_lidar=T_camera_lidar,
        distortion=_distortion(fields, fisheye),
        image_size=image_size(fields),
    )


def image_size(fields: Fields) -> tuple[int, int] | None:
    """(height, width) in pixels; None where one is missing or 0."""
    height, width = fields.whole_number(*HEIGHT), fields.whole_number(*WIDTH)
    return (height, width) if height and width else None


def _distortion(fields: Fields, fisheye: bool) -> Distortion:
    coefficients = fields.numbers(*COEFFICIENTS, mend="write [] where there is no distortion")
    model = fields.find("distortion_model")
    if model is not None:
        return fields.distortion(str(model), coefficients)
    # Distortion takes eight or more coefficients for the rational model
    return fields.distortion("fisheye" if fisheye else "plumb_bob", coefficients)
