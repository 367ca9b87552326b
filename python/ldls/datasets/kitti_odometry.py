"""KITTI odometry and SemanticKITTI: sequences of sweeps and images with one calibration each.

sequences/NN/{velodyne/NNNNNN.bin,image_2/NNNNNN.png,calib.txt}; times.txt, poses.txt (or poses/NN.txt beside sequences)
and labels/NNNNNN.label where there are any.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from ldls.camera import Camera
from ldls.checks import checked
from ldls.checks.values import as_seconds, number_of
from ldls.datasets.file_source import IMAGE_SUFFIXES, POINT_SUFFIXES, FileSource, choose, find_files, image_from_file
from ldls.datasets.frame import POSES_LEFT_OUT, CameraImage
from ldls.io import read_camera, read_poses
from ldls.io.cameras.kitti import camera_numbers
from ldls.io.files import read_lines
from ldls.io.images import read_image_size
from ldls.io.kitti_stamps import read_stamps
from ldls.sequences import Trajectory

CALIBRATION, TIMES = "calib.txt", "times.txt"


class KittiOdometrySource(FileSource):
    """The frames of a sequence of KITTI odometry or SemanticKITTI.

    Attributes:
        kind: "kitti-odometry".
        path: Folder of the sequence, as `sequences/08`.
        names: Numbers of the frames, as "000000".
        stamps: Seconds since the sequence began, of sweep and image alike; None for each without times.txt.
        left_out: Parts that incomplete frames lack, by name of the frame.
    """

    kind = "kitti-odometry"
    looks_for = "velodyne/ and calib.txt, in the folder, or in NN/ or sequences/NN/ below it"
    why_no_poses = "they come with poses.txt and times.txt"

    @checked
    def __init__(
        self,
        path: str | PathLike[str],
        *,
        sequence: str | int | None = None,
        camera: int | Sequence[int] = 2,
        truth: bool = True,
        poses: bool = True,
    ) -> None:
        """Look for the frames.

        Args:
            path: Folder of the sequence, of several, or the parent of `sequences`.
            sequence: Name of the sequence where there are several, as "08" or 8.
            camera: Number of the camera, 0 to 3, or several; 2 is the left colour camera.
            truth: Give frames their truth, where it is there.
            poses: Give frames their poses, where they are there.

        Raises:
            SourceError: A folder is missing, no frame is whole, or there are fewer times than frames.
            CalibrationError: The calibration is broken.
            FileFormatError: The file of poses is broken.
            PoseError: The poses jump, or there is not one for each time.
            FileNotFoundError: The calibration is missing.
            ParameterError: There is no such camera.
        """
        path = _sequence(Path(path), sequence)
        cameras = camera_numbers(camera)
        points = find_files(path / "velodyne", POINT_SUFFIXES)
        images = {name: find_files(path / name, IMAGE_SUFFIXES) for name in cameras}
        super().__init__(path, {"velodyne": points, **images}, cameras, truth=truth)
        calib = path / CALIBRATION
        self._cameras = {name: read_camera(calib, format="kitti", camera=n) for name, n in cameras.items()}
        self.stamps = _read_stamps(path, self.names)
        self._poses_file = _poses_file(path) if poses else None
        if not poses:
            self.why_no_poses = POSES_LEFT_OUT
        elif self._poses_file is not None and not (path / TIMES).exists():
            self.why_no_poses = f"those of {self._poses_file.name} come with {TIMES}, which is not in the folder"
        self._trajectory = _trajectory(path, self._poses_file, next(iter(self._cameras.values())))

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True for a path that looks like a sequence, or holds some."""
        return _is_sequence(path) or bool(_sequences(path)) or bool(_sequences(path / "sequences"))

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from, those of its calibration, times and poses among them."""
        shared = (self.path / CALIBRATION, self.path / TIMES, self._poses_file)
        return (*super().files(index), *(file for file in shared if file is not None and file.exists()))

    def _image(self, name: str, index: int) -> CameraImage:
        path = self._parts[name][self.names[index]]
        camera = replace(self._cameras[name], image_size=read_image_size(path))
        return image_from_file(name, path, camera, stamp=self.stamps[index])

    def _truth_files(self, name: str) -> Iterable[tuple[Path, str]]:
        return [(self.path / "labels" / f"{name}.label", "label")]


def _is_sequence(path: Path) -> bool:
    return (path / "velodyne").is_dir() and (path / CALIBRATION).is_file()


def _sequences(path: Path) -> list[str]:
    return sorted(calib.parent.name for calib in path.glob(f"*/{CALIBRATION}") if _is_sequence(calib.parent))


def _sequence(path: Path, wanted: str | int | None) -> Path:
    name = f"{wanted:02d}" if isinstance(wanted, int) else wanted
    parent = path / "sequences" if (path / "sequences").is_dir() else path
    sequences = _sequences(parent)
    if name is None and (_is_sequence(path) or not sequences):
        return path
    return parent / choose(parent, "sequence", sequences, name)


def _read_stamps(path: Path, names: Sequence[str]) -> tuple[float | None, ...]:
    return read_stamps(
        path / TIMES, names, lambda line: as_seconds("stamp", number_of(line)), example="0.103736, in seconds"
    )


def _poses_file(path: Path) -> Path | None:
    files = [path / "poses.txt"]
    if path.absolute().parent.name == "sequences":
        files.append(path.absolute().parents[1] / "poses" / f"{path.name}.txt")
    return next((file for file in files if file.exists()), None)


def _trajectory(path: Path, poses: Path | None, camera: Camera) -> Trajectory | None:
    """The way of the lidar, where the sequence has times and poses; every camera's transform is that to camera 0."""
    if poses is None or not (path / TIMES).exists():
        return None
    lines = [str(number) for number in range(len(read_lines(path / TIMES)))]
    stamps = np.array(_read_stamps(path, lines), np.float64)
    return read_poses(poses, format="kitti", stamps=stamps, T_camera_lidar=camera.T_camera_lidar)
