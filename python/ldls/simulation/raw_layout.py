"""Drives as files in the layout of KITTI's raw data.

OUT/DATE/calib_cam_to_cam.txt, calib_velo_to_cam.txt           calibration as given; P_rect_00, 01 and 03 repeat 02
OUT/DATE/DATE_drive_NNNN_sync/velodyne_points/timestamps.txt   times of the sweeps
OUT/DATE/DATE_drive_NNNN_sync/velodyne_points/data/*.bin       points
OUT/DATE/DATE_drive_NNNN_sync/image_02/timestamps.txt          times of the images
OUT/DATE/DATE_drive_NNNN_sync/image_02/data/*.png              images
OUT/DATE/DATE_drive_NNNN_sync/masks_02/*.json                  masks that the segmenter finds, as COCO JSON with scores
OUT/DATE/DATE_drive_NNNN_sync/annotations/*.txt                `instance class`, a line a point; `0 background` for none

NNNN is the seed; a day is that of the seed too, for its calibration is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from ldls.simulation.drives import PERIOD_S, Drive, drive_frame
from ldls.simulation.kitti_layout import row_of, write_lines, write_masks, write_picture, write_points, write_truth
from ldls.simulation.production import FrameSummary, make_frames
from ldls.simulation.simulated_frame import SimulatedFrame

FIRST_DAY = np.datetime64("2026-01-01")
FIRST_MOMENT = np.timedelta64(12, "h")
MADE = "calib_time: 01-Jan-2026 12:00:00"


def drive_folder(folder: str | PathLike[str], drive: Drive) -> Path:
    """Folder that `write_drive` writes a drive to."""
    day = str(FIRST_DAY + drive.seed).replace("-", "_")
    return Path(folder) / day / f"{day}_drive_{drive.seed:04d}_sync"


def write_drive(folder: str | PathLike[str], drive: Drive, *, processes: int = 1) -> Iterator[FrameSummary | None]:
    """Write the frames of a drive that are not there yet; yields each as it is done, None for one that was there.

    With more than one process, call it from a script's main part only, as Python starts processes anew.

    Raises:
        ParameterError: `processes` is below 1.
        ImportError: `ldls[sim]` is not installed.
    """
    path = drive_folder(folder, drive)
    _write_calibration(path.parent, drive)
    for sensor, later_s in (("velodyne_points", drive.sensors.delay_s), ("image_02", 0.0)):
        write_lines(path / sensor / "timestamps.txt", [_stamp(drive, k, later_s) for k in range(drive.n_frames)])
    orders = [DriveFrameOrder(drive, number) for number in range(drive.n_frames)]
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


def _stamp(drive: Drive, number: int, later_s: float) -> str:
    """A moment as KITTI writes it, to the nanosecond."""
    since = np.timedelta64(round((number * PERIOD_S + later_s) * 1e9), "ns")
    moment = (FIRST_DAY + drive.seed).astype("datetime64[ns]") + FIRST_MOMENT + since
    return str(moment).replace("T", " ")


def _write_calibration(day: Path, drive: Drive) -> None:
    mounted = drive.rig().cameras[0]
    transform = drive.sensors.drift(drive.seed) @ mounted.T_camera_lidar()
    cameras = [MADE]
    for k in range(4):
        cameras += [
            f"S_rect_{k:02d}: {mounted.model.width:.6e} {mounted.model.height:.6e}",
            f"R_rect_{k:02d}: {row_of(np.eye(3))}",
            f"P_rect_{k:02d}: {row_of(mounted.model.projection())}",
        ]
    write_lines(day / "calib_cam_to_cam.txt", cameras)
    lidar = [MADE, f"R: {row_of(transform[:3, :3])}", f"T: {row_of(transform[:3, 3])}"]
    write_lines(day / "calib_velo_to_cam.txt", lidar)
