"""Cameras from CameraInfo messages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.distortion import Distortion
from ldls.errors import CalibrationError
from ldls.io.ros.messages import InfoMessage


def camera_of(info: InfoMessage, T_camera_lidar: NDArray[np.float64], rectified: bool) -> Camera:
    """The camera that a CameraInfo message describes.

    A raw image has K and the distortion, a rectified one P. Both are of the whole sensor at full resolution; an image
    of a region of interest begins at its offset, and binning joins pixels.

    Args:
        info: sensor_msgs/CameraInfo of ROS 1 or 2.
        T_camera_lidar: (4, 4) from lidar to camera coordinates, the optical frame.
        rectified: Whether the images are rectified.

    Raises:
        CalibrationError: The camera is not calibrated, or its distortion model is unknown.
    """
    name = "P" if rectified else "K"
    matrix = _numbers(info, name).reshape(3, -1)
    if not matrix.any():
        raise CalibrationError(
            f"{name}: all zeros, so the camera is not calibrated; calibrate it, or pass a CameraInfo topic that is"
        )
    distortion = Distortion() if rectified else Distortion(info.distortion_model, tuple(_numbers(info, "D").tolist()))
    return Camera(
        projection=_image_from_sensor(info) @ matrix,
        T_camera_lidar=T_camera_lidar,
        image_size=_image_size(info),
        distortion=distortion,
    )


def _numbers(info: InfoMessage, name: str) -> NDArray[np.float64]:
    return np.asarray(getattr(info, name, getattr(info, name.lower(), ())), np.float64)


def _binning(info: InfoMessage) -> tuple[int, int]:
    """Columns and rows that make one; 0 means 1."""
    return max(info.binning_x, 1), max(info.binning_y, 1)


def _image_from_sensor(info: InfoMessage) -> NDArray[np.float64]:
    """(3, 3) from pixels of the sensor to pixels of the image; centres lie at integers in both."""
    x, y = _binning(info)
    left, top = info.roi.x_offset, info.roi.y_offset
    return np.array([[1 / x, 0, (0.5 - left) / x - 0.5], [0, 1 / y, (0.5 - top) / y - 0.5], [0, 0, 1]])


def _image_size(info: InfoMessage) -> tuple[int, int] | None:
    """(height, width) of the image; None where the message leaves it open."""
    x, y = _binning(info)
    height, width = (info.roi.height or info.height) // y, (info.roi.width or info.width) // x
    return (height, width) if height and width else None
