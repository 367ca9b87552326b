"""A drive of KITTI's raw data, synchronised and rectified.

DATE/calib_cam_to_cam.txt, DATE/calib_velo_to_cam.txt and DATE/DATE_drive_NNNN_sync/{velodyne_points,image_02}/ with
data/NNNNNNNNNN.{bin,png} and timestamps.txt. For truth, annotations/NNNNNNNNNN.txt in the drive: a class a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np

from ldls.datasets.files import IMAGE_SUFFIXES, POINT_SUFFIXES, check_folders, choose, find_files, whole_frames
from ldls.datasets.frame import CameraImage, Frame
from ldls.datasets.kitti_cameras import camera_numbers
from ldls.datasets.truth import of_points
from ldls.errors import CorruptFileError, SourceError
from ldls.evaluation import read_annotations
from ldls.io import read_camera, read_points
from ldls.io.files import read_lines
from ldls.io.images import read_image

LIDAR = "velodyne_points"


class KittiRawSource:
    """The frames of a drive.

    A frame has a sweep and an image of every camera; KITTI's drives lack some. Sweeps are KITTI's, undone of the
    car's motion to the moment at which the lidar looks ahead, when the cameras fire.

    Attributes:
        kind: "kitti-raw".
        path: Folder of the drive, as `2011_09_26/2011_09_26_drive_0001_sync`.
        names: Numbers of the frames, as "0000000000".
        stamps: Times of the sweeps in seconds since 1970, KITTI's clock taken for UTC; single ones may be None.
        left_out: What frames lack that have only some of their files, by name.
    """

    kind = "kitti-raw"
    looks_for = "velodyne_points/, in the folder or in one *_sync/ below it"

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        camera: int | Sequence[int] = 2,
        drive: str | None = None,
        truth: bool = True,
    ) -> None:
        """Look for the frames.

        Args:
            path: Folder of the drive, or of its day.
            camera: Number of the camera, 0 to 3, or several as a ring; 2 is the left colour camera.
            drive: Name of the drive's folder, if `path` is that of a day with several.
            truth: Whether frames have their truth, where it is there.

        Raises:
            SourceError: A folder is missing, no frame is whole, or there are fewer stamps than frames.
            CalibrationError: The calibration of the day is broken.
            FileNotFoundError: The calibration of the day is missing.
            ParameterError: There is no such camera.
        """
        self.path = _drive(Path(path), drive)
        folders = {f"image_{n:02d}": n for n in camera_numbers(camera)}
        check_folders(self.path, [LIDAR, *folders])
        self._cameras = {name: read_camera(self.path.parent, camera=n) for name, n in folders.items()}
        self._points = find_files(self.path / LIDAR / "data", POINT_SUFFIXES)
        self._images = {name: find_files(self.path / name / "data", IMAGE_SUFFIXES) for name in folders}
        frames = whole_frames(self.path, {LIDAR: self._points, **self._images})
        self.names, self.left_out = frames.names, frames.left_out
        self.stamps = _stamps(self.path / LIDAR, self.names)
        self._image_stamps = {name: _stamps(self.path / name, self.names) for name in folders}
        self._truth = truth

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether `path` looks like a drive, or a day with drives."""
        return (path / LIDAR).is_dir() or bool(_drives(path))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Name of the camera of each image of a frame."""
        return tuple(self._cameras)

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from."""
        name = self.names[index]
        return (self._points[name], *(files[name] for files in self._images.values()))

    def __getitem__(self, index: int) -> Frame:
        name = self.names[index]
        points = read_points(self._points[name])
        annotations = self.path / "annotations" / f"{name}.txt"
        known = self._truth and annotations.exists()
        return Frame(
            name=name,
            points=points,
            stamp=self.stamps[index],
            images=tuple(self._image(camera, index) for camera in self._cameras),
            truth=of_points(read_annotations(annotations), points, annotations) if known else None,
        )

    def _image(self, camera: str, index: int) -> CameraImage:
        path = self._images[camera][self.names[index]]
        return CameraImage(
            name=camera,
            camera=self._cameras[camera],
            read=partial(read_image, path),
            stamp=self._image_stamps[camera][index],
            path=path,
        )


def _drives(path: Path) -> list[str]:
    return sorted(folder.parent.name for folder in path.glob(f"*_sync/{LIDAR}"))


def _drive(path: Path, wanted: str | None) -> Path:
    if path.name.endswith("_extract"):
        raise SourceError(f"{path}: its images are not rectified; get the drive's '_sync' folder instead")
    drives = _drives(path)
    if wanted is None and ((path / LIDAR).is_dir() or not drives):
        return path.absolute()  # the calibration lies in its parent
    return path / choose(path, "drive", drives, wanted)


def _stamps(folder: Path, names: Sequence[str]) -> tuple[float | None, ...]:
    """Time of each frame in seconds; a line of timestamps.txt is that of the frame of its number, and may be blank."""
    path = folder / "timestamps.txt"
    if not path.exists():
        return (None,) * len(names)
    lines = read_lines(path)
    rows = [_number(folder, name) for name in names]
    if len(lines) <= max(rows):
        raise SourceError(f"{path}: has {len(lines)} stamps, expected one for each frame up to {names[-1]}")
    return tuple(_seconds(path, row + 1, lines[row]) for row in rows)


def _number(folder: Path, name: str) -> int:
    if not name.isdecimal():
        raise SourceError(f"{folder}: frame {name!r} is no number, which its line of timestamps.txt would be")
    return int(name)


def _seconds(path: Path, line: int, text: str) -> float | None:
    if not text.strip():
        return None
    try:
        return int(np.datetime64(text.strip(), "ns").astype(np.int64)) / 1e9
    except ValueError:
        raise CorruptFileError(
            f"{path}, line {line}: expected a time such as 2011-09-26 13:02:25.951199337, got {text!r}"
        ) from None
