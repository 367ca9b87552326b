"""KITTI object labels: a line of 15 fields for each object, and a 16th, the score, in results.

Their 3D boxes are truth for points too: noisy, for a box holds ground and air as well as its object. `write` makes such
lines of a result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.camera import Camera
from ldls.camera.rigid import transformed
from ldls.categories import folded, own_name
from ldls.checks import checked
from ldls.checks.values import number_of
from ldls.cloud import as_points
from ldls.errors import CorruptFileError, InputError, TruncatedFileError
from ldls.io.files import read_lines, whole_file
from ldls.io.objects import DECIMALS
from ldls.labeling import BACKGROUND, Labeling
from ldls.segmentation import Segmentation, fit_upright_box
from ldls.segmentation.objects import first_seen
from ldls.stages import project

KITTI: tuple[str, ...] = (
    "Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist", "Tram", "Misc", "DontCare",
)  # fmt: skip
"""Classes of KITTI's object labels."""
_SPELLINGS = {folded(name): name for name in KITTI}
N_FIELDS = 15
UNKNOWN_TRUNCATION = -1
UNKNOWN_OCCLUSION = 3
NO_BOX = (-1.0, -1.0, -1.0, -1.0)
"""Of an object that only images of other sweeps show."""
IMAGE_SIZE = (375, 1242)
"""Height and width of most of KITTI's images, where that of the frame is not known."""


@dataclass(frozen=True, kw_only=True)
class KittiObject:
    """One row of a label_2 file; unknown fields, such as those of DontCare rows, hold -1, -10 or -1000.

    Attributes:
        type: Class; KITTI's, spelled as KITTI does, or, in files of anyone's own, another.
        truncated: Share of the object outside the image, 0 to 1.
        occluded: 0 visible, 1 partly, 2 largely occluded, 3 unknown.
        alpha: Angle of observation in radians.
        bbox: Left, top, right, bottom in pixels.
        dimensions: Height, width, length in metres.
        location: x y z of the middle of the bottom, in metres in the rectified camera frame.
        rotation_y: Turn about the camera's y axis (down) in radians; at 0 the length lies along x.
        score: Score of a detection, where there is one.
    """

    type: str
    truncated: float
    occluded: int
    alpha: float
    bbox: tuple[float, float, float, float]
    dimensions: tuple[float, float, float]
    location: tuple[float, float, float]
    rotation_y: float
    score: float | None = None

    def line(self) -> str:
        """Its row, without the end of the line."""
        numbers = (self.alpha, *self.bbox, *self.dimensions, *self.location, self.rotation_y)
        score = () if self.score is None else (self.score,)
        words = (f"{number:.{DECIMALS}f}" for number in (*numbers, *score))
        return " ".join((self.type, f"{self.truncated:g}", str(self.occluded), *words))

    @property
    def is_region(self) -> bool:
        """True for a DontCare rectangle of the image, which is no object."""
        return self.type == "DontCare"

    def in_box_frame(self, points_camera: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) points of the camera frame along the length, up from the bottom, and across the width, in metres."""
        x, y, z = (points_camera - self.location).T
        cos, sin = np.cos(self.rotation_y), np.sin(self.rotation_y)
        with np.errstate(invalid="ignore"):
            return np.stack([cos * x - sin * z, -y, sin * x + cos * z], axis=1)

    def contains(self, points_camera: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) True for points (N, 3) of the camera frame in the box, its faces included."""
        height, width, length = self.dimensions
        along, up, across = self.in_box_frame(points_camera).T
        inside: NDArray[np.bool_] = (
            (np.abs(along) <= length / 2) & (np.abs(across) <= width / 2) & (up >= 0) & (up <= height)
        )
        return inside


def is_kitti_object(line: str) -> bool:
    """True for a line of such a file, by its number of fields."""
    return len(line.split()) in (N_FIELDS, N_FIELDS + 1)


def read_kitti_objects(path: str | PathLike[str]) -> tuple[KittiObject, ...]:
    """The objects of a label_2 file, in its order; a file without a line has none.

    Raises:
        TruncatedFileError: A line has too few fields.
        CorruptFileError: A line has too many fields, or no number where one belongs.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    lines = enumerate(read_lines(path), start=1)
    return tuple(_object(f"{path}, line {number}", line.split()) for number, line in lines if line.strip())


def read_kitti_boxes(path: str | PathLike[str], *, points: ArrayLike, camera: Camera) -> Labeling:
    """Labels of `points` by the label_2 file of their frame; see `label_by_boxes`.

    Raises:
        FileFormatError: The file is broken; see `read_kitti_objects`.
        InputError: The points cannot be used.
    """
    return label_by_boxes(read_kitti_objects(path), points, camera)


@checked
def label_by_boxes(objects: Sequence[KittiObject], points: ArrayLike, camera: Camera) -> Labeling:
    """Class of the box that holds each point; its instance is the number of the row, from 1.

    Of several boxes the smallest wins: who stands at a car is smaller than the car's box. Points outside all boxes
    whose pixel lies in a DontCare rectangle are DontCare, which `ClassSet.kitti` leaves out by default. Points out of
    the camera's view are ignored. A row without a box, its dimensions -1, holds no point.

    Args:
        objects: Rows of a label_2 file.
        points: (N, >= 3) in metres in the lidar frame.
        camera: The frame's camera; without an image size, that of most of KITTI's images.

    Raises:
        InputError: The objects are none, or the points cannot be used.
    """
    cloud = as_points(points)
    in_view, pixels = project(cloud, camera, image_size=camera.image_size or IMAGE_SIZE, keep_origin=True)
    names = tuple(dict.fromkeys([BACKGROUND, *KITTI, *(row.type for row in objects)]))
    classes, instances = np.zeros((2, len(cloud)), np.int32)
    for region in (row for row in objects if row.is_region):
        left, top, right, bottom = region.bbox
        u, v = pixels.T
        classes[in_view[(u >= left) & (u <= right) & (v >= top) & (v <= bottom)]] = names.index(region.type)
    # infinite coordinates become NaN, which lies in no box
    seen = transformed(cloud[in_view], camera.T_camera_lidar)
    boxes = [(number, row) for number, row in enumerate(objects, start=1) if not row.is_region]
    for number, row in sorted(boxes, key=lambda box: -math.prod(box[1].dimensions)):
        inside = in_view[row.contains(seen)]
        classes[inside], instances[inside] = names.index(row.type), number
    ignored = np.ones(len(cloud), bool)
    ignored[in_view] = False
    return Labeling(classes, instances, ignored, names)


def write(path: Path, result: Segmentation) -> None:
    """Write a line for each object with points of the one camera there is.

    The box is the upright one around its points in the frame of the camera, whether or not its image is rectified; the
    rectangle is the one around its mask; truncation and occlusion are unknown, -1 and 3.

    Raises:
        InputError: There are several cameras, of which the format cannot say which one an object is seen by.
    """
    if len(result.views) != 1:
        raise InputError(
            f"{path}: KITTI's labels are of one camera, the result has {len(result.views)}; save_objects writes .csv "
            "and .json of several"
        )
    rows = [_from_result(result, each.label) for each in result.objects if each.n_points]
    with whole_file(path) as file:
        file.write("".join(f"{row.line()}\n" for row in rows).encode())


def _from_result(result: Segmentation, label: int) -> KittiObject:
    instance = result.instances[label - 1]
    shown = first_seen(instance.sources, result.views)
    bbox = NO_BOX
    if shown is not None:
        top, left, rows, columns = shown[1].bounding_box
        bbox = (left, top, left + columns - 1, top + rows - 1)
    own = result.points[result.labels == label]
    box = _upright_box(transformed(own, result.views[0].view.camera.T_camera_lidar))
    x, _, z = box.location
    return replace(
        box,
        # any other name stays, with `_` for blanks, which separate fields
        type=own_name(instance.name, KITTI, {}) or "_".join(instance.name.split()) or "Misc",
        alpha=wrapped(box.rotation_y - math.atan2(x, z)),
        bbox=bbox,
        score=float(instance.score),
    )


def _upright_box(points_camera: NDArray[np.float64]) -> KittiObject:
    """A nameless object whose box holds (n, 3) points of the camera frame, its numbers rounded as in files."""
    # axes as a lidar has them: forward, left, up
    box = fit_upright_box(points_camera[:, [2, 0, 1]] * (1, -1, -1))
    forward, left, up = box.center
    bottom = up - box.size[2] / 2
    placed = KittiObject(
        type="",
        truncated=UNKNOWN_TRUNCATION,
        occluded=UNKNOWN_OCCLUSION,
        alpha=0.0,
        bbox=(0, 0, 0, 0),
        dimensions=(0, 0, 0),
        location=(round(-left, DECIMALS), _above(-bottom), round(forward, DECIMALS)),
        rotation_y=round(wrapped(-box.yaw - math.pi / 2), DECIMALS),
    )
    along, up_from_bottom, across = placed.in_box_frame(points_camera).T
    height, width, length = up_from_bottom.max(), 2 * np.abs(across).max(), 2 * np.abs(along).max()
    return replace(placed, dimensions=(_above(height), _above(width), _above(length)))


def _above(number: float) -> float:
    """The next number above with `DECIMALS` decimals, so that points on a side of the box lie in it."""
    steps = 10.0**DECIMALS
    return (math.floor(number * steps) + 1) / steps


def wrapped(angle: float) -> float:
    """The angle from -pi to pi."""
    return math.remainder(angle, 2 * math.pi)


def _object(place: str, words: list[str]) -> KittiObject:
    if len(words) < N_FIELDS:
        raise TruncatedFileError(f"{place}: expected 15 fields, or 16 with a score, got {len(words)}")
    if len(words) > N_FIELDS + 1:
        raise CorruptFileError(f"{place}: expected 15 fields, or 16 with a score, got {len(words)}")
    v = [_number(place, word) for word in words[1:]]
    return KittiObject(
        type=_SPELLINGS.get(folded(words[0]), words[0]),
        truncated=v[0],
        occluded=int(v[1]),
        alpha=v[2],
        bbox=(v[3], v[4], v[5], v[6]),
        dimensions=(v[7], v[8], v[9]),
        location=(v[10], v[11], v[12]),
        rotation_y=v[13],
        score=v[14] if len(v) == N_FIELDS else None,
    )


def _number(place: str, word: str) -> float:
    try:
        number = number_of(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise CorruptFileError(f"{place}: expected a finite number, got {word!r}")
    return number
