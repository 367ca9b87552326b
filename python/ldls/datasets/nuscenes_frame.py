"""A single nuScenes key frame beside its files: frame.json.

It has the `timestamp` in seconds; `lidar` with `file` and `columns`; `cameras` by name, each with `file`, `timestamp`,
`intrinsics` (3 x 3), `lidar_to_camera` (4 x 4, the car's motion between the stamps included) and `boxes_2d`; and
`boxes_3d`, whose `center_size_yaw` is x y z of the middle, length, width, height in metres and yaw, in the lidar frame.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.checks import checked
from ldls.checks.values import as_seconds
from ldls.cloud import MAX_COLUMNS, Points
from ldls.datasets.file_source import described_in, image_from_file
from ldls.datasets.frame import CameraImage, Frame, Source
from ldls.errors import CorruptFileError, within
from ldls.io import read_points
from ldls.io.files import below, open_file, parsing
from ldls.io.images import read_image_size
from ldls.labeling import BACKGROUND, Labeling

FILE = "frame.json"
MAX_BYTES = 1 << 24


@dataclass(frozen=True)
class Box2d:
    """A rectangle of an image.

    Attributes:
        category: Name of what it holds.
        ltrb_px: Left, top, right, bottom in pixels.
    """

    category: str
    ltrb_px: tuple[float, float, float, float]


class NuScenesFrameSource(Source):
    """One key frame with six cameras.

    Its truth is that of the 3D boxes, the smaller where two hold a point; instances are the numbers of boxes, from 1.

    Attributes:
        kind: "nuscenes-frame".
        path: Folder of frame.json.
        names: The name of the sweep's file without its ending.
        stamps: Time of the sweep in seconds since 1970.
    """

    kind = "nuscenes-frame"
    looks_for = "frame.json"

    @checked
    def __init__(self, path: str | PathLike[str], *, truth: bool = True) -> None:
        """Read frame.json.

        Args:
            path: The file, or its folder.
            truth: Give the frame its truth.

        Raises:
            CorruptFileError: It is not such a file.
            UnsafePathError: It names a file out of its folder.
            FileNotFoundError: It, or a file that it names, is not there.
        """
        self._file = described_in(path, FILE)
        self.path = self._file.parent
        self._truth = truth
        with open_file(self._file, "key frame", limit=MAX_BYTES) as file:
            frame = json.loads(file.text())
            self._points = self._path(frame["lidar"]["file"])
            self._columns = _n_columns(frame["lidar"]["columns"])
            self._boxes: list[dict[str, Any]] = frame["boxes_3d"]
            self._images = tuple(self._image(name, each) for name, each in frame["cameras"].items())
            stamp = as_seconds("timestamp", float(frame["timestamp"]), CorruptFileError)
            self.stamps = (stamp,)
        self.names = (self._points.name.split(".")[0],)
        self.camera_names = tuple(image.name for image in self._images)

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True for a frame.json, and for a folder that holds one."""
        return described_in(path, FILE).name == FILE and described_in(path, FILE).is_file()

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from."""
        images = tuple(image.path for image in self._images if image.path is not None)
        return (self._file, self._points, *images)

    def __getitem__(self, index: int) -> Frame:
        name, stamp = self.names[index], self.stamps[index]
        points = read_points(self._points, columns=self._columns)
        with within(self._file), parsing("key frame"):
            truth = label_by_upright_boxes(self._boxes, points) if self._truth else None
        return Frame(name=name, points=points, stamp=stamp, images=self._images, truth=truth)

    def _image(self, name: str, each: Mapping[str, Any]) -> CameraImage:
        path = self._path(each["file"])
        camera = Camera(
            projection=each["intrinsics"],
            T_camera_lidar=each["lidar_to_camera"],
            image_size=read_image_size(path),
        )
        return image_from_file(name, path, camera, stamp=float(each["timestamp"]), moved=True)

    def _path(self, name: str) -> Path:
        return below(self.path, name, place=str(self._file))


def read_boxes_2d(path: str | PathLike[str]) -> dict[str, tuple[Box2d, ...]]:
    """The 2D boxes of each camera's image, by the camera's name; masks may be made from them.

    Args:
        path: The frame.json, or its folder.

    Raises:
        CorruptFileError: It is not such a file.
        FileNotFoundError: There is no such file.
    """
    with open_file(described_in(path, FILE), "key frame", limit=MAX_BYTES) as file:
        frame = json.loads(file.text())
        return {name: tuple(_box_2d(box) for box in each["boxes_2d"]) for name, each in frame["cameras"].items()}


def label_by_upright_boxes(boxes: Sequence[Mapping[str, Any]], points: Points) -> Labeling:
    """Class and number of the smallest box that holds each point.

    Args:
        boxes: Each with `category` and `center_size_yaw`.
        points: (N, >= 3) in metres in the lidar frame.
    """
    names = tuple(dict.fromkeys([BACKGROUND, *(str(box["category"]) for box in boxes)]))
    classes, instances = np.zeros((2, len(points)), np.int32)
    numbered = list(enumerate((_upright(box) for box in boxes), start=1))
    for number, (category, numbers) in sorted(numbered, key=lambda box: -math.prod(box[1][1][3:6].tolist())):
        inside = points_in_upright_box(points, numbers)
        classes[inside], instances[inside] = names.index(category), number
    return Labeling(classes, instances, np.zeros(len(points), bool), names)


def points_in_upright_box(points: Points, numbers: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N,) True for points in the box x y z of its middle, length, width, height and yaw, its faces included."""
    centre, (length, width, height), yaw = numbers[:3], numbers[3:6], numbers[6]
    # infinite coordinates become NaN, which lies in no box
    with np.errstate(invalid="ignore", over="ignore"):
        x, y, z = (points[:, :3].astype(np.float64) - centre).T
        along, across = np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x
    inside: NDArray[np.bool_] = (
        (np.abs(along) <= length / 2) & (np.abs(across) <= width / 2) & (np.abs(z) <= height / 2)
    )
    return inside


def _n_columns(columns: Sequence[str]) -> int:
    if columns[:3] != ["x", "y", "z"] or len(columns) > MAX_COLUMNS:
        raise ValueError(f"lidar.columns: expected x, y, z and up to {MAX_COLUMNS - 3} more, got {columns}")
    return len(columns)


def _upright(box: Mapping[str, Any]) -> tuple[str, NDArray[np.float64]]:
    numbers = np.array(box["center_size_yaw"], np.float64)
    if numbers.shape != (7,) or not np.isfinite(numbers).all():
        raise ValueError(f"center_size_yaw is {box['center_size_yaw']}, expected seven finite numbers")
    return str(box["category"]), numbers


def _box_2d(box: Mapping[str, Any]) -> Box2d:
    left, top, right, bottom = map(float, box["box"])
    return Box2d(str(box["category"]), (left, top, right, bottom))
