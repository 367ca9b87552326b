"""KITTI odometry and SemanticKITTI: sequences of sweeps and images with one calibration each.

sequences/NN/{velodyne/NNNNNN.bin,image_2/NNNNNN.png,calib.txt}; times.txt and labels/NNNNNN.label where there are any.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from ldls.cloud import Points
from ldls.datasets.files import IMAGE_SUFFIXES, POINT_SUFFIXES, choose, find_files, whole_frames
from ldls.datasets.frame import CameraImage, Frame
from ldls.datasets.kitti_cameras import camera_numbers, image_from_file
from ldls.datasets.truth import of_points
from ldls.errors import CorruptFileError, SourceError
from ldls.evaluation import Labeling, read_semantic_kitti
from ldls.io import read_camera, read_points
from ldls.io.files import read_lines


class KittiOdometrySource:
    """The frames of a sequence of KITTI odometry or SemanticKITTI.

    Attributes:
        kind: "kitti-odometry".
        path: Folder of the sequence, as `sequences/08`.
        names: Numbers of the frames, as "000000".
        stamps: Seconds since the sequence began, of sweep and image alike; None for each without times.txt.
        left_out: What frames lack that have only some of their files, by name.
    """

    kind = "kitti-odometry"
    looks_for = "velodyne/ and calib.txt, in the folder, or in NN/ or sequences/NN/ below it"

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        sequence: str | int | None = None,
        camera: int | Sequence[int] = 2,
        truth: bool = True,
    ) -> None:
        """Look for the frames.

        Args:
            path: Folder of the sequence, of several, or the parent of `sequences`.
            sequence: Which of several, as "08" or 8.
            camera: Number of the camera, 0 to 3, or several; 2 is the left colour camera.
            truth: Whether frames have their truth, where it is there.

        Raises:
            SourceError: A folder is missing, no frame is whole, or there are fewer times than frames.
            CalibrationError: The calibration is broken.
            FileNotFoundError: The calibration is missing.
            ParameterError: There is no such camera.
        """
        self.path = _sequence(Path(path), sequence)
        numbers = camera_numbers(camera)
        self._points = find_files(self.path / "velodyne", POINT_SUFFIXES)
        self._images = {n: find_files(self.path / f"image_{n}", IMAGE_SUFFIXES) for n in numbers}
        images = {f"image_{n}": files for n, files in self._images.items()}
        frames = whole_frames(self.path, {"velodyne": self._points, **images})
        self._cameras = {n: read_camera(self.path / "calib.txt", format="kitti", camera=n) for n in numbers}
        self.names, self.left_out = frames.names, frames.left_out
        self.stamps = _stamps(self.path / "times.txt", self.names)
        self._truth = truth

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether `path` looks like a sequence, or holds some."""
        return _is_sequence(path) or bool(_sequences(path)) or bool(_sequences(path / "sequences"))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Name of the camera of each image of a frame."""
        return tuple(f"image_{number}" for number in self._images)

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from."""
        name = self.names[index]
        return (self._points[name], *(files[name] for files in self._images.values()))

    def __getitem__(self, index: int) -> Frame:
        name = self.names[index]
        points = read_points(self._points[name])
        return Frame(
            name=name,
            points=points,
            stamp=self.stamps[index],
            images=tuple(self._image(number, index) for number in self._cameras),
            truth=self._read_truth(name, points) if self._truth else None,
        )

    def _image(self, number: int, index: int) -> CameraImage:
        camera, path = self._cameras[number], self._images[number][self.names[index]]
        return image_from_file(
            f"image_{number}", path, lambda size: replace(camera, image_size=size), stamp=self.stamps[index]
        )

    def _read_truth(self, name: str, points: Points) -> Labeling | None:
        path = self.path / "labels" / f"{name}.label"
        return of_points(read_semantic_kitti(path), points, path) if path.exists() else None


def _is_sequence(path: Path) -> bool:
    return (path / "velodyne").is_dir() and (path / "calib.txt").is_file()


def _sequences(path: Path) -> list[str]:
    return sorted(calib.parent.name for calib in path.glob("*/calib.txt") if _is_sequence(calib.parent))


def _sequence(path: Path, wanted: str | int | None) -> Path:
    name = f"{wanted:02d}" if isinstance(wanted, int) else wanted
    parent = path / "sequences" if (path / "sequences").is_dir() else path
    found = _sequences(parent)
    if name is None and (_is_sequence(path) or not found):
        return path
    return parent / choose(parent, "sequence", found, name)


def _stamps(path: Path, names: Sequence[str]) -> tuple[float | None, ...]:
    """Time of each frame in seconds; a line of times.txt is that of the frame of its number."""
    if not path.exists():
        return (None,) * len(names)
    lines = read_lines(path)
    rows = [int(name) if name.isdecimal() else len(lines) for name in names]
    if len(lines) <= max(rows):
        raise SourceError(f"{path}: has {len(lines)} times, expected one for each frame up to {names[-1]}")
    return tuple(_seconds(path, row + 1, lines[row]) for row in rows)


def _seconds(path: Path, line: int, text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise CorruptFileError(f"{path}, line {line}: expected a time in seconds, got {text!r}")
    return seconds
