"""A drive of KITTI's raw data, synchronised and rectified.

DATE/calib_cam_to_cam.txt, DATE/calib_velo_to_cam.txt and DATE/DATE_drive_NNNN_sync/{velodyne_points,image_02}/ with
data/NNNNNNNNNN.{bin,png} and timestamps.txt. For the times of points, velodyne_points/timestamps_start.txt and
timestamps_end.txt. For poses, oxts/ beside them and DATE/calib_imu_to_velo.txt. For truth,
annotations/NNNNNNNNNN.txt in the drive: a class a point.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.checks import checked
from ldls.cloud import Points
from ldls.datasets.file_source import (
    IMAGE_SUFFIXES,
    POINT_SUFFIXES,
    FileSource,
    check_folders,
    choose,
    find_files,
    image_from_file,
)
from ldls.datasets.frame import POSES_LEFT_OUT, CameraImage
from ldls.errors import CorruptFileError, SourceError
from ldls.io import read_camera, read_poses
from ldls.io.cameras.kitti import RAW_FILES, camera_numbers
from ldls.io.kitti_stamps import CLOCK_EXAMPLE, clock_seconds, read_stamps
from ldls.io.poses.kitti_raw import CALIBRATION, STAMPS
from ldls.sequences import Trajectory

LIDAR, OXTS = "velodyne_points", "oxts"
START, END = "timestamps_start.txt", "timestamps_end.txt"
"""Times at which the lidar looks back and a sweep begins and ends; at that of `STAMPS` it looks ahead."""
LONGEST_TURN_S = 1.0


class KittiRawSource(FileSource):
    """The frames of a drive.

    A frame has a sweep and an image of every camera; KITTI's drives lack some. Sweeps have the motion of the car in
    them: each point is measured when the lidar looks at it, and the stamp of the sweep is the moment at which it looks
    ahead and fires the cameras, whatever the stamps of their images. Times of points follow from their azimuth, where
    the drive has the times at which its sweeps begin and end.

    Seen from above the lidar turns clockwise, from the left over ahead to the right. (The readme of KITTI's development
    kit has it the other way round. Its data do not: of a car that comes nearer from behind, what is to the right of the
    place where sweeps begin and end is nearer, and so measured later.) Each laser looks some degrees to the side of the
    others, so times are wrong by a millisecond or two, and within these degrees of straight behind by a turn.

    Attributes:
        kind: "kitti-raw".
        path: Folder of the drive, as `2011_09_26/2011_09_26_drive_0001_sync`.
        names: Numbers of the frames, as "0000000000".
        stamps: Times of the sweeps in seconds since 1970, KITTI's clock taken for UTC; single ones may be None.
        left_out: Parts that incomplete frames lack, by name of the frame.
    """

    kind = "kitti-raw"
    looks_for = "velodyne_points/, in the folder or in one *_sync/ below it"
    why_no_poses = "they come with oxts/ and the day's calib_imu_to_velo.txt"

    @checked
    def __init__(
        self,
        path: str | PathLike[str],
        *,
        camera: int | Sequence[int] = 2,
        drive: str | None = None,
        truth: bool = True,
        poses: bool = True,
    ) -> None:
        """Look for the frames.

        Args:
            path: Folder of the drive, or of its day.
            camera: Number of the camera, 0 to 3, or several as a ring; 2 is the left colour camera.
            drive: Name of the drive's folder, if `path` is that of a day with several.
            truth: Give frames their truth, where it is there.
            poses: Give frames their poses, where they are there.

        Raises:
            SourceError: A folder is missing, no frame is whole, or there are fewer stamps than frames.
            CalibrationError: The calibration of the day is broken.
            FileFormatError: A file of poses is broken.
            PoseError: The poses jump.
            FileNotFoundError: The calibration of the day is missing.
            ParameterError: There is no such camera.
        """
        path = _drive(Path(path), drive)
        cameras = camera_numbers(camera, digits=2)
        check_folders(path, [LIDAR, *cameras])
        self._cameras = {name: read_camera(path.parent, camera=n) for name, n in cameras.items()}
        points = find_files(path / LIDAR / "data", POINT_SUFFIXES)
        images = {name: find_files(path / name / "data", IMAGE_SUFFIXES) for name in cameras}
        super().__init__(path, {LIDAR: points, **images}, cameras, truth=truth)
        self.stamps = _stamps(path / LIDAR / STAMPS, self.names)
        self._trajectory = _trajectory(path) if poses else None
        if not poses:
            self.why_no_poses = POSES_LEFT_OUT
        self._measured = _measured(path) if self._trajectory is not None else ()
        self._image_stamps = {name: _stamps(path / name / STAMPS, self.names) for name in cameras}
        self._turns = _turns(path / LIDAR, self.names)

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True for a path that looks like a drive, or a day with drives."""
        return (path / LIDAR).is_dir() or bool(_drives(path))

    def _image(self, camera: str, index: int) -> CameraImage:
        path = self._parts[camera][self.names[index]]
        stamp = self._image_stamps[camera][index]
        # the lidar fires the cameras at its stamp; theirs is when images had come to the computer
        return image_from_file(camera, path, self._cameras[camera], stamp=stamp, moved=True)

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from; of the poses those around its times, and what all of them share."""
        cameras = (self.path.parent / name for name in RAW_FILES)
        clocks = [self.path / LIDAR / name for name in (STAMPS, START, END)]
        clocks += [self.path / name / STAMPS for name in self.camera_names]
        own = (*super().files(index), *cameras, *(clock for clock in clocks if clock.exists()))
        moments = self._moments(index)
        if self._trajectory is None or not moments:
            return own
        last = len(self._measured) - 1
        before, after = np.searchsorted(self._trajectory.stamps, [min(moments), max(moments)]).tolist()
        # two at least, for beyond the ends the motion there goes on
        beside = self._measured[max(min(before, last) - 1, 0) : max(after, 1) + 1]
        shared = (self.path.parent / CALIBRATION, self.path / OXTS / STAMPS)
        # the world begins at the first
        return (*own, *shared, *dict.fromkeys((self._measured[0], *beside)))

    def _moments(self, index: int) -> list[float]:
        """The stamp of a frame, and when its sweep begins and ends."""
        stamp = self.stamps[index]
        return [] if stamp is None else [stamp, *(self._turns[index] or ())]

    def _times(self, index: int, points: Points) -> NDArray[np.float64] | None:
        stamp, turn = self.stamps[index], self._turns[index]
        if stamp is None or turn is None:
            return None
        start, end = turn
        if not (start <= stamp <= end <= start + LONGEST_TURN_S):
            raise CorruptFileError(
                f"{self.path / LIDAR}: frame {self.names[index]} begins {start - stamp:+.6f} s and ends "
                f"{end - stamp:+.6f} s from its stamp, expected one before and one after, at most {LONGEST_TURN_S:g} s "
                f"apart; mend {START} and {END}, or remove them if points are all of their stamps"
            )
        left = np.arctan2(points[:, 1], points[:, 0]).astype(np.float64) / np.pi
        return np.where(left > 0, (start - stamp) * left, (stamp - end) * left)

    def _truth_files(self, name: str) -> Iterable[tuple[Path, str]]:
        return [(self.path / "annotations" / f"{name}.txt", "annotations")]


def _drives(path: Path) -> list[str]:
    return sorted(folder.parent.name for folder in path.glob(f"*_sync/{LIDAR}"))


def _drive(path: Path, wanted: str | None) -> Path:
    if path.name.endswith("_extract"):
        raise SourceError(f"{path}: its images are not rectified; get the drive's '_sync' folder instead")
    drives = _drives(path)
    if wanted is None and ((path / LIDAR).is_dir() or not drives):
        return path.absolute()  # the calibration lies in its parent
    return path / choose(path, "drive", drives, wanted)


def _trajectory(path: Path) -> Trajectory | None:
    """The way of the lidar, where the drive has its measurements and the day their calibration."""
    there = (path / OXTS / "data").is_dir() and (path.parent / CALIBRATION).exists()
    return read_poses(path / OXTS, format="kitti-raw") if there else None


def _measured(path: Path) -> tuple[Path, ...]:
    """The file of each pose; what has no stamp is none."""
    files = find_files(path / OXTS / "data", (".txt",))
    stamps = _stamps(path / OXTS / STAMPS, tuple(files))
    return tuple(file for file, stamp in zip(files.values(), stamps, strict=True) if stamp is not None)


def _turns(folder: Path, names: Sequence[str]) -> tuple[tuple[float, float] | None, ...]:
    """When each sweep begins and ends; None where that is not known."""
    starts, ends = (_stamps(folder / name, names) for name in (START, END))
    pairs = zip(starts, ends, strict=True)
    return tuple(None if start is None or end is None else (start, end) for start, end in pairs)


def _stamps(path: Path, names: Sequence[str]) -> tuple[float | None, ...]:
    return read_stamps(path, names, clock_seconds, example=CLOCK_EXAMPLE)
