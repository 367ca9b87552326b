"""CameraInfo messages of ROS 1 and ROS 2, and dicts with the same names.

Source: https://docs.ros.org/en/api/sensor_msgs/html/msg/CameraInfo.html.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera.distortion import Distortion
from ldls.camera.fields import Fields
from ldls.camera.rigid import from_parts, rigid
from ldls.errors import CalibrationError

MESSAGE_FIELDS = (
    "height", "width", "distortion_model", "D", "d", "K", "k", "R", "r", "P", "p", "binning_x", "binning_y", "roi",
)  # fmt: skip
ROI_FIELDS = ("x_offset", "y_offset", "height", "width")
UNCALIBRATED = "calibrate the camera, or wait until its driver sends the calibration"


def arguments(fields: Fields, T_camera_lidar: NDArray[np.float64], *, rectified: bool) -> dict[str, Any]:
    """Arguments of `Camera` from the fields of a message.

    Region of interest and binning change the full image that the matrices are of: first it is cut, then it shrinks.

    Args:
        fields: The message.
        T_camera_lidar: (4, 4) from lidar to the coordinates of the camera as it is mounted.
        rectified: True if masks are of the rectified image (P and R) instead of the raw one (K and D).

    Raises:
        CalibrationError: The camera is not calibrated, or a field is missing or cannot be a camera's.
    """
    offset, binning, size = _part(fields)
    if rectified:
        rotation = np.eye(3)
        if fields.find("R", "rectification_matrix") is not None:
            rotation = fields.matrix((3, 3), "R", "rectification_matrix")
        return {
            "projection": _cropped(_not_zero(fields, (3, 4), "P", "projection_matrix"), offset, binning),
            "T_camera_lidar": rigid(f"{fields.place}: R", from_parts(rotation)) @ T_camera_lidar,
            "image_size": size,
        }
    return {
        "projection": _cropped(_not_zero(fields, (3, 3), "K", "camera_matrix"), offset, binning),
        "T_camera_lidar": T_camera_lidar,
        "distortion": _distortion(fields),
        "image_size": size,
    }


def as_fields(message: object) -> Fields:
    """The fields of a message or of a dict with the same names."""
    if isinstance(message, Fields):
        return message
    if isinstance(message, Mapping):
        return Fields("camera_info", message)
    return Fields("camera_info", _attributes(message, MESSAGE_FIELDS))


def _attributes(message: object, names: tuple[str, ...]) -> dict[str, object]:
    return {name: getattr(message, name) for name in names if hasattr(message, name)}


def _not_zero(fields: Fields, shape: tuple[int, int], *spellings: str) -> NDArray[np.float64]:
    matrix = fields.matrix(shape, *spellings, mend=UNCALIBRATED)
    if not matrix.any():
        raise CalibrationError(f"{fields.place}: {spellings[0]}: all zeros, expected focal lengths; {UNCALIBRATED}")
    return matrix


def _distortion(fields: Fields) -> Distortion:
    coefficients = fields.numbers("D", "distortion_coefficients", mend="make it [] where there is no distortion")
    model = str(fields.find("distortion_model") or "")
    if not model and coefficients.any():
        raise CalibrationError(
            f"{fields.place}: distortion_model is missing beside D {coefficients.tolist()}, "
            "expected plumb_bob, rational_polynomial or equidistant"
        )
    return fields.distortion(model, coefficients)


def _part(fields: Fields) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, int] | None]:
    """The part of the full image that is left: cut to a region, then shrunk by binning.

    Returns:
        Its offset (2,) x y in pixels of the full image, its binning (2,) x y in such pixels a pixel, and its (height,
        width), if known.
    """
    roi = fields.find("roi")
    region = roi if isinstance(roi, Mapping) else _attributes(roi, ROI_FIELDS)
    roi_fields = Fields(f"{fields.place}: roi", region)
    offset = np.array([roi_fields.whole_number(name) or 0 for name in ("x_offset", "y_offset")])
    binning = np.array([fields.whole_number(name) or 1 for name in ("binning_x", "binning_y")])
    full, cut = fields.image_size(), roi_fields.image_size()
    kept = cut or full
    if full and cut and not (offset[::-1] + cut <= full).all():
        raise CalibrationError(
            f"{roi_fields.place}: {cut} (height, width) at x {offset[0]}, y {offset[1]} is not inside {full}"
        )
    size = (kept[0] // int(binning[1]), kept[1] // int(binning[0])) if kept else None
    return offset.astype(np.float64), binning.astype(np.float64), size


def _cropped(
    matrix: NDArray[np.float64], offset: NDArray[np.float64], binning: NDArray[np.float64]
) -> NDArray[np.float64]:
    """`matrix`, (3, 3) or (3, 4), to pixels of what is left of the full image."""
    cropped = matrix.copy()
    with np.errstate(over="ignore", invalid="ignore"):  # the camera refuses what is then not finite
        # a pixel of a binned image has its centre in the middle of those it is made of
        cropped[:2] += (0.5 - offset[:, None]) * matrix[2]
        cropped[:2] /= binning[:, None]
        cropped[:2] -= 0.5 * matrix[2]
    return cropped
