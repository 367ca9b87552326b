"""`ldls.toml`, which describes a plain folder of frames."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Distortion
from ldls.camera.rigid import as_matrix
from ldls.checks import did_you_mean
from ldls.datasets.stored_masks import FRAME
from ldls.errors import CorruptFileError, ParameterError, within
from ldls.io.files import open_file

FILE = "ldls.toml"
MAX_BYTES = 1 << 16
MAX_DOTS = 256
"""Dots on a line: all the numbers of several cameras have fewer."""
TOP: dict[str, tuple[type, ...]] = {
    "points": (str,), "columns": (int,), "stamps": (str,), "truth": (str,), "truth_format": (str,), "cameras": (dict,),
}  # fmt: skip
CAMERA: dict[str, tuple[type, ...]] = {
    "images": (str,), "masks": (str,), "stamps": (str,), "calibration": (str,), "calibration_camera": (int, str),
    "fisheye": (bool,), "rectified": (bool,), "K": (list,), "T_camera_lidar": (list, str, dict), "image_size": (list,),
    "distortion": (dict,),
}  # fmt: skip
KINDS = {str: "a text", int: "a whole number", bool: "true or false", list: "a list", dict: "a table"}
DISTORTION: dict[str, tuple[type, ...]] = {"model": (str,), "coefficients": (list,)}

OPTIONS = {"calibration_camera": "camera", "fisheye": "fisheye", "rectified": "rectified"}
"""Options of `ldls.read_camera` by key."""

TEMPLATE = """\
# Where the frames of this folder lie. {frame} stands for the name of a frame; paths are relative to this folder.
points = "lidar/{frame}.bin"        # any format of docs/formats.md: x y z first, in metres
columns = 4                         # floats a row of a .bin: 4 by default, 5 for .pcd.bin
stamps = "lidar/stamps.txt"         # optional: lines `frame seconds`; # begins a comment
truth = "labels/{frame}.label"      # optional: any format that `ldls evaluate` reads
truth_format = "label"              # only where the file's ending does not tell

# one table a camera; its calibration inline ...
[cameras.front]
images = "front/{frame}.png"
masks = "front_masks/{frame}.json"  # optional: any format of docs/masks.md, or one .json of all images
stamps = "front/stamps.txt"         # optional
image_size = [480, 640]             # optional: height, width in pixels; else that of each image
K = [[525.0, 0.0, 319.5], [0.0, 525.0, 239.5], [0.0, 0.0, 1.0]]
# lidar to camera: camera x right, y down, z forward
T_camera_lidar = [
    [0.0, -1.0, 0.0, 0.0],
    [0.0, 0.0, -1.0, -0.1],
    [1.0, 0.0, 0.0, -0.1],
    [0.0, 0.0, 0.0, 1.0],
]
# "plumb_bob" k1 k2 p1 p2 k3, "rational_polynomial" (8, 12 or 14 numbers), "equidistant" (4); leave it out for rectified
# images
distortion = { model = "plumb_bob", coefficients = [-0.05, 0.01, 0.0, 0.0, 0.0] }

# ... or by a file of any format of docs/formats.md, one for all frames or, with {frame}, one a frame
[cameras.left]
images = "left/{frame}.png"
calibration = "calib/{frame}.txt"
calibration_camera = 2              # which of the file's cameras: KITTI's 2, Kalibr's "cam0", 1 of a pair by default

# ... and where the lidar is beside it: a matrix as above, a file of it, or the camera's pose by its parts
[cameras.right]
images = "right/{frame}.png"
calibration = "right.yaml"
fisheye = false                     # optional: whether OpenCV's coefficients are those of cv2.fisheye
# rectified = true                  # of a CameraInfo: masks are of the rectified image
[cameras.right.T_camera_lidar]
pose_of = "camera"                  # "camera": its pose in the lidar frame; "lidar": that of the lidar in the camera's
translation = [0.1, -0.2, 0.0]
quaternion_xyzw = [0.0, 0.0, 0.0, 1.0]  # or quaternion_wxyz, roll_pitch_yaw_deg, rotation (3 x 3)
optical = false                     # the camera's frame has x forward, y left, z up; true by default: x right, y down
"""
"""A complete ldls.toml with every key, to be changed."""


@dataclass(frozen=True, kw_only=True)
class CameraDescription:
    """A camera as ldls.toml describes it.

    Attributes:
        images: Pattern of its images.
        masks: Pattern of their masks, or one file of all of them, if there are any.
        stamps: File of their stamps, if there is one.
        calibration: Pattern of calibration files, where the calibration is not inline.
        options: Options of `ldls.read_camera` for those files, but for T_camera_lidar.
        K: The intrinsic matrix, where the calibration is inline.
        distortion: The distortion beside K.
        T_camera_lidar: Where the lidar is: a matrix, a table of parts, or a pattern of files.
        image_size: (height, width) in pixels, where it is given.
    """

    images: str
    masks: str | None
    stamps: str | None
    calibration: str | None
    options: Mapping[str, Any]
    K: NDArray[np.float64] | None
    distortion: Distortion
    T_camera_lidar: list[Any] | dict[str, Any] | str | None
    image_size: tuple[int, int] | None


@dataclass(frozen=True, kw_only=True)
class FolderDescription:
    """The content of an ldls.toml.

    Attributes:
        points: Pattern of the sweeps.
        columns: Floats a row of `.bin` files; None for the default.
        stamps: File of the sweeps' stamps, if there is one.
        truth: Pattern of the true labels, if there are any.
        truth_format: Their format, where the ending does not tell.
        cameras: Cameras by name.
    """

    points: str
    columns: int | None
    stamps: str | None
    truth: str | None
    truth_format: str | None
    cameras: Mapping[str, CameraDescription]


def read_description(path: Path) -> FolderDescription:
    """Read and check an ldls.toml.

    Raises:
        CorruptFileError: It is no TOML.
        ParameterError: A key is unknown, missing, or of another type, or masks of one image would be several images'.
        CalibrationError: A camera cannot be.
        FileNotFoundError: There is no such file.
    """
    with open_file(path, "TOML file", limit=MAX_BYTES) as file:
        text = file.text()
        # the parser takes the square of the parts of a key in time
        if max(line.count(".") for line in text.split("\n")) > MAX_DOTS:
            raise CorruptFileError(f"a line with more than {MAX_DOTS} dots; no key has so many parts")
        content = tomllib.loads(text)
        _check(str(path), content, TOP, needed=("points", "cameras"))
        cameras = {name: _camera(f"{path}, cameras.{name}", each) for name, each in content["cameras"].items()}
        if not cameras:
            raise ParameterError("cameras: expected a table [cameras.NAME] or more")
        _check_masks(str(path), {name: each.masks for name, each in cameras.items() if each.masks is not None})
        return FolderDescription(
            points=content["points"],
            columns=content.get("columns"),
            stamps=content.get("stamps"),
            truth=content.get("truth"),
            truth_format=content.get("truth_format"),
            cameras=cameras,
        )


def _camera(place: str, content: Any) -> CameraDescription:  # noqa: ANN401
    _check(place, content, CAMERA, needed=("images",))
    inline = [key for key in ("K", "distortion") if key in content]
    by_file = [key for key in ("calibration", *OPTIONS) if key in content]
    if inline and by_file:
        raise ParameterError(f"{place}: has {', '.join(inline)} and {', '.join(by_file)}; expected one or the other")
    if "calibration" not in content and not {"K", "T_camera_lidar"} <= content.keys():
        raise ParameterError(f"{place}: has no calibration; expected K and T_camera_lidar, or calibration")
    size = _image_size(place, content.get("image_size"))
    return CameraDescription(
        images=content["images"],
        masks=content.get("masks"),
        stamps=content.get("stamps"),
        calibration=content.get("calibration"),
        options={option: content[key] for key, option in OPTIONS.items() if key in content},
        K=_matrix(place, content.get("K")),
        distortion=_distortion(place, content.get("distortion", {})),
        T_camera_lidar=content.get("T_camera_lidar"),
        image_size=size,
    )


def _check_masks(path: str, masks: Mapping[str, str]) -> None:
    """Refuse places of masks, by their cameras, that do not tell frames or cameras apart."""
    first: dict[str, str] = {}
    for camera, place in masks.items():
        named = f"{path}, cameras.{camera}: masks is {place!r}"
        if "{camera}" in place:
            raise ParameterError(f"{named}, expected {{frame}} and nothing else in braces; write the camera's name")
        if FRAME not in place:
            if not place.lower().endswith(".json"):
                raise ParameterError(
                    f"{named}, expected {{frame}} where the name of the frame stands, or one .json of all images"
                )
        elif place in first:
            raise ParameterError(
                f"{named}, as of cameras.{first[place]}, and both would get the masks of one image; name a file of "
                "each camera, or one .json of all images"
            )
        first.setdefault(place, camera)


def _matrix(place: str, K: list[Any] | None) -> NDArray[np.float64] | None:
    with within(place):
        return None if K is None else as_matrix("K", K, ((3, 3), (3, 4)))


def _distortion(place: str, content: Mapping[str, Any]) -> Distortion:
    _check(f"{place}.distortion", content, DISTORTION, needed=())
    with within(place):
        return Distortion(content.get("model", "none"), tuple(content.get("coefficients", ())))


def _image_size(place: str, size: list[Any] | None) -> tuple[int, int] | None:
    if size is None:
        return None
    if len(size) != 2 or not all(isinstance(side, int) and side > 0 for side in size):
        raise ParameterError(f"{place}: image_size is {size}, expected [height, width] in pixels")
    return size[0], size[1]


def _check(place: str, content: Any, keys: Mapping[str, tuple[type, ...]], *, needed: tuple[str, ...]) -> None:  # noqa: ANN401
    if not isinstance(content, dict):
        raise ParameterError(f"{place}: expected a table, got {content!r}")
    for key, value in content.items():
        if key not in keys:
            expected = f"expected {', '.join(keys)}{did_you_mean(key, keys)}"
            raise ParameterError(f"{place}: unknown key {key!r}, {expected}")
        if type(value) not in keys[key]:
            expected = " or ".join(KINDS[kind] for kind in keys[key])
            raise ParameterError(f"{place}: {key} is {value!r}, expected {expected}")
    missing = [key for key in needed if key not in content]
    if missing:
        raise ParameterError(f"{place}: lacks {', '.join(missing)}; found {', '.join(content) or 'nothing'}")
