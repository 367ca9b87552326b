"""Drives as files in the layout of KITTI's raw data.

OUT/DATE/calib_cam_to_cam.txt, calib_velo_to_cam.txt           calibration as given; P_rect_00, 01 and 03 repeat 02
OUT/DATE/calib_imu_to_velo.txt                                 the IMU is in the place of the lidar
OUT/DATE/DATE_drive_NNNN_sync/drive.json                       what the drive is made of; no other goes on with it
OUT/DATE/DATE_drive_NNNN_sync/oxts/timestamps.txt              times of the poses: those of the sweeps
OUT/DATE/DATE_drive_NNNN_sync/oxts/data/*.txt                  true poses, as latitude, longitude, altitude and angles
OUT/DATE/DATE_drive_NNNN_sync/velodyne_points/timestamps.txt   times of the sweeps
OUT/DATE/DATE_drive_NNNN_sync/velodyne_points/timestamps_start.txt, timestamps_end.txt  begin and end of turns, if any
OUT/DATE/DATE_drive_NNNN_sync/velodyne_points/data/*.bin       points
OUT/DATE/DATE_drive_NNNN_sync/image_02/timestamps.txt          times of the images
OUT/DATE/DATE_drive_NNNN_sync/image_02/data/*.png              images
OUT/DATE/DATE_drive_NNNN_sync/masks_02/*.json                  masks that the segmenter finds, as COCO JSON with scores
OUT/DATE/DATE_drive_NNNN_sync/annotations/*.txt                `instance class`, a line a point; `0 background` for none

NNNN is the seed; a day is that of the seed too, for its calibration is.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.io.poses.kitti_raw import EARTH_RADIUS_M
from ldls.simulation.drives import PERIOD_S, Drive, drive_frame, drive_plan, drive_poses
from ldls.simulation.kitti_layout import (
    check_there,
    row_of,
    write_lines,
    write_masks,
    write_picture,
    write_points,
    write_truth,
)
from ldls.simulation.production import FrameSummary, check_processes, make_frames
from ldls.simulation.simulated_frame import SimulatedFrame

FIRST_DAY = np.datetime64("2026-01-01")
FIRST_MOMENT = np.timedelta64(12, "h")
LATITUDE, LONGITUDE = 49.0, 8.4
"""Degrees at which every drive begins."""
BEGIN, END = "timestamps_start", "timestamps_end"
MADE = "calib_time: 01-Jan-2026 12:00:00"


def drive_folder(folder: str | PathLike[str], drive: Drive) -> Path:
    """Folder that `write_drive` writes a drive to."""
    day = str(FIRST_DAY + drive.seed).replace("-", "_")
    return Path(folder) / day / f"{day}_drive_{drive.seed:04d}_sync"


def write_drive(folder: str | PathLike[str], drive: Drive, *, processes: int = 1) -> Iterator[FrameSummary | None]:
    """Write the frames of a drive that are not there yet; yields each as it is done, None for one that was there.

    A drive may go on with more frames where the first ones stay as they are. With more than one process, call it from a
    script's main part only, as Python starts processes anew.

    Raises:
        ParameterError: `processes` is below 1, or the folder has another drive of this seed, or more frames of it.
        ImportError: `ldls[sim]` is not installed.
    """
    check_processes(processes)
    path = drive_folder(folder, drive)
    orders = [DriveFrameOrder(drive, number) for number in range(drive.n_frames)]
    shared = {path / "drive.json": _made_of(drive)} | _calibration(path.parent, drive) | _stamps(path, drive)
    for number, pose in enumerate(drive_poses(drive)):
        shared[path / "oxts/data" / f"{number:010d}.txt"] = [_measured(drive, pose)]
    check_there(path, shared, "another drive, or more frames")
    for file, lines in shared.items():
        if lines:
            write_lines(file, lines)
    yield from make_frames(folder, orders, processes=processes)


@dataclass(frozen=True)
class DriveFrameOrder:
    """One frame of a drive to be made.

    Attributes:
        drive: The drive.
        number: Number of the frame, from 0.
    """

    drive: Drive
    number: int

    @property
    def name(self) -> str:
        """Ten digits."""
        return f"{self.number:010d}"

    def is_whole(self, folder: str | PathLike[str]) -> bool:
        """True where the frame is in `folder`; its annotations come last."""
        return (drive_folder(folder, self.drive) / "annotations" / f"{self.name}.txt").is_file()

    def make(self, folder: str | PathLike[str]) -> SimulatedFrame:
        """Make and write the frame."""
        frame, path = drive_frame(self.drive, self.number), drive_folder(folder, self.drive)
        (image,) = frame.images
        write_points(path / "velodyne_points/data" / f"{self.name}.bin", frame)
        write_picture(path / "image_02/data" / f"{self.name}.png", image.read())
        write_masks(path / "masks_02" / f"{self.name}.json", image.masks, self.number)
        write_truth(path / "annotations" / f"{self.name}.txt", frame)
        return frame


def _made_of(drive: Drive) -> list[str]:
    """What all frames of a drive depend on; more frames may make it slower, and clear more things out of its way."""
    settings = asdict(drive) | {"speed_m_s": drive.speed_m_s, "n_things": len(drive_plan(drive).placed)}
    del settings["n_frames"]
    return json.dumps(settings, indent=1).splitlines()


def _stamps(path: Path, drive: Drive) -> dict[Path, list[str]]:
    """The files of times, empty ones for begin and end of turns where the lidar does not spin."""
    delay_s, half_s = drive.sensors.delay_s, PERIOD_S / 2
    later = {"velodyne_points/timestamps": delay_s, "oxts/timestamps": delay_s, "image_02/timestamps": 0.0}
    turns = {f"velodyne_points/{BEGIN}": delay_s - half_s, f"velodyne_points/{END}": delay_s + half_s}
    stamps = {name: [_stamp(drive, k, s) for k in range(drive.n_frames)] for name, s in (later | turns).items()}
    if not drive.spinning:
        stamps |= {name: [] for name in turns}
    return {path / f"{name}.txt": lines for name, lines in stamps.items()}


def _measured(drive: Drive, pose: NDArray[np.float64]) -> str:
    """The 30 numbers of KITTI's GPS and IMU at a pose, x east: where it is, how it turns and moves, and zeros."""
    east_m, north_m, up_m = pose[:3, 3]
    yaw, turn = np.arctan2(pose[1, 0], pose[0, 0]), np.radians(drive.turn_deg_s)
    scaled_m, latitude = EARTH_RADIUS_M * np.cos(np.radians(LATITUDE)), np.radians(LATITUDE)
    stretched = np.log(np.tan(np.pi / 4 + latitude / 2)) + north_m / scaled_m
    place = (90 * (4 / np.pi * np.arctan(np.exp(stretched)) - 1), LONGITUDE + np.degrees(east_m / scaled_m), up_m)
    speeds = (drive.speed_m_s * np.sin(yaw), drive.speed_m_s * np.cos(yaw), drive.speed_m_s, 0, 0)
    numbers = (*place, 0, 0, yaw, *speeds, *[0] * 6, 0, 0, turn, 0, 0, turn, *[0] * 7)
    return " ".join(f"{number:.15g}" for number in numbers)


def _stamp(drive: Drive, number: int, later_s: float) -> str:
    """A moment as KITTI writes it, to the nanosecond."""
    since = np.timedelta64(round((number * PERIOD_S + later_s) * 1e9), "ns")
    moment = (FIRST_DAY + drive.seed).astype("datetime64[ns]") + FIRST_MOMENT + since
    return str(moment).replace("T", " ")


def _calibration(day: Path, drive: Drive) -> dict[Path, list[str]]:
    """The files of the calibration as given."""
    mounted = drive.rig().cameras[0]
    transform = drive.sensors.drift(drive.seed) @ mounted.T_camera_lidar()
    cameras = [MADE]
    for k in range(4):
        cameras += [
            f"S_rect_{k:02d}: {mounted.model.width:.6e} {mounted.model.height:.6e}",
            f"R_rect_{k:02d}: {row_of(np.eye(3))}",
            f"P_rect_{k:02d}: {row_of(mounted.model.projection())}",
        ]
    lidar = [MADE, f"R: {row_of(transform[:3, :3])}", f"T: {row_of(transform[:3, 3])}"]
    return {
        day / "calib_cam_to_cam.txt": cameras,
        day / "calib_velo_to_cam.txt": lidar,
        day / "calib_imu_to_velo.txt": [MADE, f"R: {row_of(np.eye(3))}", f"T: {row_of(np.zeros(3))}"],
    }
