"""KITTI object labels: a line of 15 fields for each object, and a 16th, the score, in results."""

from __future__ import annotations

import math
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from ldls.errors import CorruptFileError, TruncatedFileError
from ldls.io.files import read_lines

N_FIELDS = 15


@dataclass(frozen=True, kw_only=True)
class KittiObject:
    """One row of a label_2 file; unknown fields, such as those of DontCare rows, hold -1, -10 or -1000.

    Attributes:
        type: Class; KITTI's or, in files of anyone's own, another.
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

    @property
    def is_region(self) -> bool:
        """Whether this is a DontCare rectangle of the image instead of an object."""
        return self.type == "DontCare"


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


def _object(place: str, words: list[str]) -> KittiObject:
    if len(words) < N_FIELDS:
        raise TruncatedFileError(f"{place}: expected 15 fields, or 16 with a score, got {len(words)}")
    if len(words) > N_FIELDS + 1:
        raise CorruptFileError(f"{place}: expected 15 fields, or 16 with a score, got {len(words)}")
    v = [_number(place, word) for word in words[1:]]
    return KittiObject(
        type=words[0],
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
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise CorruptFileError(f"{place}: expected a finite number, got {word!r}")
    return number
