"""nuScenes, and data sets in its layout: key frames of cameras and a lidar, by the tables of the data set.

FOLDER/v1.0-mini/*.json, FOLDER/samples/LIDAR_TOP, FOLDER/samples/CAM_FRONT and so on; for truth FOLDER/panoptic or
FOLDER/lidarseg with their tables.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.checks import checked
from ldls.cloud import Points
from ldls.datasets import nuscenes_tables as tables
from ldls.datasets.file_source import check_truth, choose, counts_of, image_from_file, warn_left_out
from ldls.datasets.frame import POSES_LEFT_OUT, CameraImage, Frame, Source
from ldls.datasets.nuscenes_tables import Reading
from ldls.errors import SourceError
from ldls.io import read_points
from ldls.io.files import below
from ldls.io.labels.nuscenes_labels import read_lidarseg, read_panoptic
from ldls.labeling import Labeling

LIDAR = "LIDAR_TOP"
CAMERAS = ("CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_BACK_RIGHT", "CAM_BACK", "CAM_BACK_LEFT", "CAM_FRONT_LEFT")
COLUMNS = 5
TRUTHS = {"panoptic": read_panoptic, "lidarseg": read_lidarseg}
"""Readers of the tables of truth, the one with instances first."""


class NuScenesSource(Source):
    """The key frames of one scene of nuScenes, or of all.

    The car moves between the stamps of sweep and images; each camera's transform contains that.

    Attributes:
        kind: "nuscenes".
        path: Folder of the data set.
        camera_names: The cameras of the tables, nuScenes' own in its order first.
        names: Scene and number of each frame in it, as "scene-0061_007"; scenes in the order of their time.
        stamps: Times of the sweeps in seconds since 1970.
        left_out: Parts that incomplete frames lack, by name of the frame.
    """

    kind = "nuscenes"
    looks_for = "v1.0-*/sample_data.json"
    why_no_poses = POSES_LEFT_OUT

    @checked
    def __init__(
        self,
        path: str | PathLike[str],
        *,
        scene: str | None = None,
        version: str | None = None,
        lidar: str | None = None,
        truth: bool = True,
        poses: bool = True,
    ) -> None:
        """Read the tables, a row at a time; what is kept is some 6 kB a frame.

        Args:
            path: Folder of the data set.
            scene: Name of a scene, as "scene-0061"; all of them without it.
            version: Name of the tables' folder, as "v1.0-mini", if there are several.
            lidar: Channel of the lidar; LIDAR_TOP, or the only one there is, without it.
            truth: Give frames their truth, where it is there.
            poses: Give frames their poses; cameras have the car's motion by these in any case.

        Raises:
            SourceError: A table is missing, no frame is whole, or there is no such scene.
            FileFormatError: A table is broken.
            CalibrationError: A pose is none, or a camera has no intrinsic matrix.
            UnsafePathError: A table names a file out of the folder.
            FileNotFoundError: There is no such folder.
        """
        self.path = Path(path)
        folder = tables.find_tables(self.path, version)
        samples = tables.read_sample_names(folder, scene)
        channels = tables.read_channels(folder)
        lidars, cameras = (
            [*dict.fromkeys(channel for channel, kind in channels.values() if kind == wanted)]
            for wanted in ("lidar", "camera")
        )
        if not lidars or not cameras:
            raise SourceError(f"{folder / 'sensor.json'}: has no {'camera' if lidars else 'lidar'}")
        self._lidar = choose(folder, "lidar", lidars, LIDAR if lidar is None and LIDAR in lidars else lidar)
        # nuScenes' own cameras in its order
        self.camera_names = tuple(sorted(cameras, key=lambda c: CAMERAS.index(c) if c in CAMERAS else len(CAMERAS)))
        wanted = (self._lidar, *self.camera_names)
        sensors = tables.read_sensors(folder, channels, wanted)
        readings = tables.read_readings(folder, samples, sensors)
        self._sensors = {token: sensor for token, sensor in sensors.items() if sensor is not None}
        missing = _missing(self.path, readings, wanted)
        self.left_out = {samples[token]: f"no {' and no '.join(what)}" for token, what in missing.items()}
        self.names = tuple(name for token, name in samples.items() if token not in missing)
        if not self.names:
            why = counts_of(self.left_out.values())
            raise SourceError(f"{self.path}: none of {len(samples)} key frames has all its files: {why}")
        warn_left_out(self.path, self.left_out.values(), len(samples))
        self._frames = tuple(readings[token] for token in samples if token not in missing)
        self.stamps = tuple(frame[self._lidar].stamp_us / 1e6 for frame in self._frames)
        self._tables, self._posed = folder, poses
        self._poses = tables.read_poses(folder, {taken.pose for frame in self._frames for taken in frame.values()})
        sweeps = {frame[self._lidar].token for frame in self._frames} if truth else set()
        self._truths = {name: tables.read_truth_files(folder, name, sweeps) for name in TRUTHS}
        self._classes = tables.read_classes(folder) if any(self._truths.values()) else {}

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True for a path that looks like nuScenes."""
        return any(path.glob("v1.0-*/sample_data.json"))

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from, the tables among them."""
        taken = (self._file(taken.filename) for taken in self._frames[index].values())
        return (*taken, *(self._tables / f"{name}.json" for name in tables.TABLES))

    def __getitem__(self, index: int) -> Frame:
        frame = self._frames[index]
        sweep = frame[self._lidar]
        points = read_points(self._file(sweep.filename), columns=COLUMNS)
        return Frame(
            name=self.names[index],
            points=points,
            stamp=self.stamps[index],
            pose=self._pose(sweep) if self._posed else None,
            images=tuple(self._image(channel, frame[channel], sweep) for channel in self.camera_names),
            truth=self._read_truth(sweep.token, points),
        )

    def _pose(self, taken: Reading) -> NDArray[np.float64]:
        """(4, 4) from coordinates of a sensor to those of the map, at the moment of its reading."""
        pose: NDArray[np.float64] = self._poses[taken.pose] @ self._sensors[taken.sensor].T_ego_sensor
        return pose

    def _image(self, channel: str, taken: Reading, sweep: Reading) -> CameraImage:
        sensor = self._sensors[taken.sensor]
        camera = Camera(
            projection=sensor.intrinsic,
            T_camera_lidar=np.linalg.inv(self._pose(taken)) @ self._pose(sweep),
            image_size=taken.size,
            distortion=sensor.distortion,
        )
        return image_from_file(channel, self._file(taken.filename), camera, stamp=taken.stamp_us / 1e6, moved=True)

    def _read_truth(self, sweep: str, points: Points) -> Labeling | None:
        for name, read in TRUTHS.items():
            if sweep in self._truths[name]:
                path = self._file(self._truths[name][sweep])
                return check_truth(read(path, classes=self._classes), points, path)
        return None

    def _file(self, name: str) -> Path:
        return below(self.path, name, place=f"{self.path}, tables")


def _missing(
    path: Path, readings: Mapping[str, Mapping[str, Reading]], channels: Sequence[str]
) -> dict[str, list[str]]:
    """Channels that a sample lacks, by its token; folders are listed once, for there may be 240,000 files."""
    names = {taken.filename for frame in readings.values() for taken in frame.values()}
    there = _listed(path, {str(Path(name).parent) for name in names})
    lacks = {
        token: [c for c in channels if c not in frame or str(Path(frame[c].filename)) not in there]
        for token, frame in readings.items()
    }
    return {token: channels for token, channels in lacks.items() if channels}


def _listed(path: Path, folders: Iterable[str]) -> set[str]:
    inside = [below(path, folder, place=f"{path}, tables") for folder in folders]
    return {str(child.relative_to(path)) for folder in inside if folder.is_dir() for child in folder.iterdir()}
