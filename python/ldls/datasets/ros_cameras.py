"""Cameras from CameraInfo messages of bags."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.camera.camera_info import MESSAGE_FIELDS
from ldls.io.ros.messages import Message

ROTATION = ("R", "r")


def camera_of(info: Message, T_camera_lidar: NDArray[np.float64], rectified: bool) -> Camera:
    """The camera that a CameraInfo message describes, by K and D of raw images and by P of rectified ones.

    Transforms of ROS lead to the frame in which P projects points (`image_geometry` does so), which R leads to from the
    camera as it is mounted; so R is left out here.

    Args:
        info: sensor_msgs/CameraInfo of ROS 1 or 2.
        T_camera_lidar: (4, 4) from lidar to camera coordinates, the optical frame.
        rectified: Whether the images are rectified.

    Raises:
        CalibrationError: The camera is not calibrated, or its distortion model is unknown.
    """
    names = (name for name in MESSAGE_FIELDS if name not in ROTATION and hasattr(info, name))
    fields = {name: getattr(info, name) for name in names}
    return Camera.from_camera_info(fields, T_camera_lidar, rectified=rectified)
