"""Sources whose frames are files of one name, and what others share with them."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.cloud import Points
from ldls.datasets.frame import LEAVE_POSES_OUT, CameraImage, Frame, Source
from ldls.errors import InputError, LeftOutWarning, PoseError, SourceError, some, within
from ldls.io import read_image, read_points
from ldls.io.labels import read_labeling
from ldls.io.names import is_hidden, name_order
from ldls.labeling import Labeling
from ldls.masks import InstanceMasks
from ldls.sequences import Trajectory

POINT_SUFFIXES = (".bin", ".npy")
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")


class FileSource(Source):
    """A source whose frames are files of one name: a sweep, an image of each camera, and others.

    Attributes:
        path: Folder of the source.
        names: Names of the frames of which every file is there, in the order of `name_order`.
        stamps: Times of the sweeps in seconds; None where the source does not say.
        left_out: Parts that the others lack, by name of the frame.
        camera_names: Name of the camera of each image of a frame.
    """

    def __init__(
        self,
        path: Path,
        parts: Mapping[str, Mapping[str, Path]],
        camera_names: Iterable[str],
        *,
        truth: bool,
        columns: int | None = None,
    ) -> None:
        """Keep the frames that have a file of each part; warns of sweeps that lack one.

        Args:
            path: Folder of the source.
            parts: Files by frame of each part, as "velodyne" and "image_2"; the first are the sweeps.
            camera_names: Name of the camera of each image of a frame.
            truth: Give frames their truth, where it is there.
            columns: Floats a row of `.bin` files.

        Raises:
            SourceError: No frame is whole.
        """
        self.path, self.camera_names = path, tuple(camera_names)
        self._parts, self._truth, self._columns = parts, truth, columns
        lacks = {name: [part for part in parts if name not in parts[part]] for name in set().union(*parts.values())}
        self.names = tuple(sorted((name for name, missing in lacks.items() if not missing), key=name_order))
        if not self.names:
            counts = ", ".join(f"{part} {len(files)}" for part, files in parts.items())
            raise SourceError(f"{path}: no frame has a file in each of these, found {counts}; names must agree")
        self.stamps: tuple[float | None, ...] = (None,) * len(self.names)
        self._trajectory: Trajectory | None = None
        left_out = sorted((name for name, missing in lacks.items() if missing), key=name_order)
        self.left_out = {name: f"no {' and no '.join(lacks[name])}" for name in left_out}
        self._points = next(iter(parts.values()))
        warn_left_out(path, [why for name, why in self.left_out.items() if name in self._points], len(self._points))

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from."""
        return tuple(files[self.names[index]] for files in self._parts.values())

    def __getitem__(self, index: int) -> Frame:
        name = self.names[index]
        points = read_points(self._points[name], columns=self._columns)
        images = tuple(self._image(camera, index) for camera in self.camera_names)
        truth = self._read_truth(name, points, images[0].camera) if self._truth else None
        return Frame(
            name=name,
            points=points,
            times=self._times(index, points),
            stamp=self.stamps[index],
            pose=self._pose(index),
            trajectory=self._trajectory,
            images=images,
            truth=truth,
        )

    def _times(self, index: int, points: Points) -> NDArray[np.float64] | None:
        """When each point of a frame was measured, in seconds after its stamp; None where nobody knows."""
        return None

    def _pose(self, index: int) -> NDArray[np.float64] | None:
        """T_world_lidar of a frame, where its stamp and the way of the lidar are known.

        Raises:
            PoseError: The way has a gap there.
        """
        stamp = self.stamps[index]
        if self._trajectory is None or stamp is None:
            return None
        with within(f"{self.path}, pose of frame {self.names[index]}"):
            try:
                return self._trajectory.at(stamp)
            except PoseError as error:
                raise PoseError(f"{error}; {LEAVE_POSES_OUT}") from None

    def _image(self, camera: str, index: int) -> CameraImage:
        """The image of a camera in a frame."""
        raise NotImplementedError

    def _truth_files(self, name: str) -> Iterable[tuple[Path, str | None]]:
        """Files that may hold the truth of a frame, and their formats; the first that is there does."""
        raise NotImplementedError

    def _read_truth(self, name: str, points: Points, camera: Camera) -> Labeling | None:
        for path, format in self._truth_files(name):
            if path.exists():
                return check_truth(read_labeling(path, format=format, points=points, camera=camera), points, path)
        return None


def find_files(folder: Path, suffixes: Sequence[str]) -> dict[str, Path]:
    """Files of `folder` with one of the suffixes, by their names without it; hidden ones left out.

    Raises:
        SourceError: There is no such folder; the message says what is there.
    """
    check_folders(folder.parent, [folder.name])
    files = (path for path in folder.iterdir() if path.suffix in suffixes and not is_hidden(path.name))
    return {path.name.removesuffix(path.suffix): path for path in sorted(files, key=lambda path: name_order(path.name))}


def described_in(path: str | PathLike[str], name: str) -> Path:
    """The file of that name that `path` is, or holds."""
    return Path(path) / name if Path(path).is_dir() else Path(path)


def warn_left_out(path: Path, reasons: Iterable[str], n_sweeps: int) -> None:
    """Warn of sweeps that are left out, if there are any, by what they lack."""
    counted = Counter(reasons)
    if counted:
        message = f"{path}: {counted.total()} of {n_sweeps} sweeps are left out: {counts_of(counted)}"
        warnings.warn(message, LeftOutWarning, stacklevel=4)


def counts_of(reasons: Iterable[str]) -> str:
    """Counts of the reasons, the most frequent first."""
    return ", ".join(f"{count:,} {reason}" for reason, count in Counter(reasons).most_common())


def check_folders(path: Path, names: Iterable[str]) -> None:
    """Refuse a source that lacks a folder.

    Raises:
        SourceError: One is missing; the message says what is there.
        FileNotFoundError: There is no such source.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such folder")
    missing = [name for name in names if not (path / name).is_dir()]
    if missing:
        there = some(sorted(child.name for child in path.iterdir())) or "nothing"
        raise SourceError(f"{path}: has no folder {', '.join(missing)}; found {there}")


def choose(path: Path, what: str, there: Sequence[str], wanted: str | None) -> str:
    """The one of `there` that is wanted, or the only one there is.

    Raises:
        SourceError: It is not there, or there are several and none is wanted.
    """
    if wanted is None and len(there) == 1:
        return there[0]
    if wanted is not None and wanted in there:
        return wanted
    listed = some(there) or "none"
    if wanted is None:
        raise SourceError(f"{path}: holds {len(there)} {what}s ({listed}); say which by {what}=")
    raise SourceError(f"{path}: has no {what} {wanted!r}; found {listed}")


def image_from_file(
    name: str,
    path: Path,
    camera: Camera,
    *,
    stamp: float | None = None,
    masks: InstanceMasks | None = None,
    moved: bool = False,
) -> CameraImage:
    """An image of a frame whose pixels are those of a file."""
    read = partial(read_image, path)
    return CameraImage(name=name, camera=camera, read=read, stamp=stamp, path=path, masks=masks, moved=moved)


def check_truth(truth: Labeling, points: Points, path: Path) -> Labeling:
    """`truth`, read from `path`, if it has a label for each point.

    Raises:
        InputError: It has fewer or more.
    """
    if len(truth) != len(points):
        raise InputError(f"{path}: labels: {len(truth):,}, points: {len(points):,}; expected one label a point")
    return truth
