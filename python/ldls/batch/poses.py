"""Where the lidar was at each frame of a run: by a file of poses, by odometry, or as the source says."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.batch.settings import RunSettings
from ldls.batch.window import Frames
from ldls.datasets import Frame, Source
from ldls.datasets.file_source import counts_of
from ldls.datasets.frame import LEAVE_POSES_OUT
from ldls.datasets.nuscenes import NuScenesSource
from ldls.errors import LdlsError, LdlsWarning, PoseError, some, within
from ldls.io import read_poses
from ldls.io.files import MAX_TEXT_BYTES, digest_of, open_file
from ldls.io.names import name_order
from ldls.io.poses import kitti
from ldls.io.poses.pose_rows import pose_rows
from ldls.io.poses.read import format_of
from ldls.sequences import Trajectory
from ldls.sequences.odometry import PERIOD_S

KISS_ICP = "kiss-icp"
"""What stands in the place of a file where the sweeps themselves are to say how the lidar moved."""
FOUND_POSES = "poses.txt"
"""File in the folder of the run that these poses are kept in, in TUM's format."""
FOUND = "poses that ldls found by kiss-icp"
"""First line of this file, a comment."""


def holds_found_poses(folder: Path) -> bool:
    """True for the folder of a run that keeps poses which its sweeps told."""
    path, first = folder / FOUND_POSES, f"# {FOUND}\n".encode()
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(first)) == first


class Poses:
    """The poses of the frames of a source.

    Attributes:
        stamps: Time of each frame in seconds; None where it is not known. Frames of a source without any time are
            taken 0.1 s apart where poses are given.
        sha256: Digest of the file of poses; None without one.
    """

    def __init__(self, source: Source, settings: RunSettings) -> None:
        """Read the file of poses, if one is given.

        Raises:
            LdlsError: The file is broken, or is of another drive.
            FileNotFoundError: There is no such file, or a folder.
        """
        self._source, self._settings = source, settings
        self._path = path = Path(settings.poses or "")
        self.stamps = _stamps(source, settings)
        self._trajectory: Trajectory | None = None
        self.sha256: str | None = None
        if settings.poses is not None:
            if path.is_dir() or not path.exists():
                found = "a folder" if path.is_dir() else "no such file"
                raise FileNotFoundError(f"{path}: {found}, expected a file of poses by TUM or KITTI, or {KISS_ICP}")
            self.sha256 = digest_of(path)
            self._trajectory = _trajectory(path, source, self.stamps)

    def of(self, index: int, frame: Frame) -> NDArray[np.float64] | None:
        """(4, 4) T_world_lidar of frame `index`; None where it is not known and not needed.

        Raises:
            PoseError: It is needed and not known, or the file of poses has none at its stamp.
        """
        pose, stamp = frame.pose, self.stamps[index]
        if self._trajectory is not None:
            with self._within_file():
                pose = None if stamp is None else self._trajectory.at(stamp)
        if self._settings.sweeps and (stamp is None or pose is None):
            what = "stamp" if stamp is None else "pose"
            raise PoseError(f"the frame has no {what}, without which it cannot be joined with others; leave it out")
        return pose

    def deskewed(self, frame: Frame) -> Frame:
        """The frame as it was at its stamp, by the file of poses or by its source; see `Frame.deskewed`.

        Raises:
            PoseError: The poses do not say how the lidar moved during the sweep.
        """
        if self._trajectory is None:
            try:
                return frame.deskewed()
            except PoseError as error:
                raise PoseError(f"poses of {self._source.path}: {error}; {LEAVE_POSES_OUT}") from None
        with self._within_file():
            return frame.deskewed(self._trajectory)

    @contextmanager
    def _within_file(self) -> Iterator[None]:
        """Begin errors with the file of poses; where a run found these, say how to find them anew."""
        with within(self._path):
            try:
                yield
            except PoseError as error:
                if not self._are_found:
                    raise
                raise PoseError(
                    f"{error}; or, if a sweep was mended, give another --out to find the way anew"
                ) from None

    @property
    def _are_found(self) -> bool:
        """True for a file of poses that a run found."""
        return self._path.name == FOUND_POSES and holds_found_poses(self._path.parent)

    def check(self, chosen: Frames) -> None:
        """Refuse, before any work, frames without poses where they are needed, or in another order than their stamps.

        Raises:
            PoseError: There is no stamp or no pose, or stamps do not ascend where objects are tracked.
        """
        self._check_clock()
        if not self._settings.sweeps and not self._settings.track:
            return
        named = zip(self._source.names, self.stamps, strict=True)
        known = [(name, stamp) for name, stamp in named if stamp is not None]
        # only sources whose frames may have poses say why there are none
        why = getattr(self._source, "why_no_poses", "")
        if not known:
            raise PoseError(
                f"{self._source.path}: frames of this source ({self._source.kind}) have no stamps, expected them and "
                f"poses{f' ({why})' if why else ''} for --sweeps and --track; take a source with times, as an "
                "ldls.toml with stamps, or give --poses"
            )
        unordered = (pair for pair in pairwise(known) if not pair[0][1] < pair[1][1])
        if self._settings.track and (pair := next(unordered, None)) is not None:
            (one, before), (other, after) = pair
            if before == after:
                raise PoseError(
                    f"{self._source.path}: frames {one} and {other} have one stamp ({before:.6f} s), expected "
                    "ascending stamps to track objects; mend the stamps of the source, or take one of these frames out "
                    "of it"
                )
            one_drive = "take one drive by --option scene=NAME"
            mend = one_drive if self._source.kind == NuScenesSource.kind else "mend the stamps of the source"
            raise PoseError(
                f"{self._source.path}: frame {other} ({after:.6f} s) comes after {one} ({before:.6f} s), expected "
                f"ascending stamps to track objects; {mend}"
            )
        if self._trajectory is None and not self._has_poses(chosen):
            raise PoseError(
                f"{self._source.path}: frames of this source ({self._source.kind}) have no poses, expected them for "
                f"--sweeps and --track; {f'{why}; else ' if why else ''}give --poses FILE, or --poses "
                f"{KISS_ICP}"
            )

    def _check_clock(self) -> None:
        """Refuse a file that has a pose of no frame; warn of one with stamps for frames that have none of their own."""
        trajectory = self._trajectory
        if trajectory is None or format_of(self._path) == "kitti":
            # which has no stamps, and takes those of the frames
            return
        first, last = float(trajectory.stamps[0]), float(trajectory.stamps[-1])
        stamps = [stamp for stamp in self.stamps if stamp is not None]
        are_own = any(stamp is not None for stamp in _own_stamps(self._source))
        times = (
            f"are from {min(stamps):.6f} to {max(stamps):.6f} s"
            if are_own
            else f"have no times, and are taken {PERIOD_S:g} s apart from 0"
        )
        message = (
            f"{self._settings.poses}: frames of {self._source.path} {times}; the file has poses from {first:.6f} to "
            f"{last:.6f} s"
        )
        if not any(first - trajectory.margin_s <= stamp <= last + trajectory.margin_s for stamp in stamps):
            mend = "give poses by the clock of the frames, in seconds" if are_own else "add stamps to the source"
            raise PoseError(f"{message}, which is at none of the frames; {mend}")
        if not are_own and not self._are_found:
            warnings.warn(
                f"{message}; add stamps to the source if its frames are of other times", LdlsWarning, stacklevel=5
            )

    def _has_poses(self, chosen: Frames) -> bool:
        """False if the first frame that can be read and has a stamp has no pose."""
        stamped = [index for index, _ in chosen if self.stamps[index] is not None]
        frame = next(_readable(self._source, stamped), None)
        return frame is None or frame.pose is not None


def _stamps(source: Source, settings: RunSettings) -> tuple[float | None, ...]:
    stamps = _own_stamps(source)
    if settings.poses is None or any(stamp is not None for stamp in stamps):
        return stamps
    return tuple(PERIOD_S * number for number in range(len(source)))


def _own_stamps(source: Source) -> tuple[float | None, ...]:
    # sources of others may have no such attribute
    return tuple(getattr(source, "stamps", (None,) * len(source)))


def _trajectory(path: Path, source: Source, times: tuple[float | None, ...]) -> Trajectory:
    """The way of the lidar by a file; one of KITTI's has a line for each frame of the source, or those left out too."""
    if format_of(path) != "kitti":
        return read_poses(path)
    stamps = [stamp for stamp in times if stamp is not None]
    if len(stamps) < len(source):
        raise PoseError(
            f"{path}: KITTI's poses have no times, and {len(source) - len(stamps)} of {len(source)} frames of "
            f"{source.path} have none either; give a file in TUM's format, or add times"
        )
    # where none can be read, the first says why
    frame = next(_readable(source, range(len(source))), None) or source[0]
    with within(path):
        T_camera_lidar = frame.images[0].camera.T_camera_lidar
        return kitti.read(path, stamps=stamps, T_camera_lidar=T_camera_lidar, chosen=_lines(path, source))


def _lines(path: Path, source: Source) -> list[int] | slice:
    """Which poses of a file of KITTI's are those of the frames, by their number in it.

    Raises:
        PoseError: The source left out frames, and the file has a line neither for each frame that it kept nor for all.
    """
    left_out: Mapping[str, str] = getattr(source, "left_out", {})
    if not left_out:
        return slice(None)
    every = sorted([*source.names, *left_out], key=name_order)
    kept = [number for number, name in enumerate(every) if name not in left_out]
    with open_file(path, "file of poses", limit=MAX_TEXT_BYTES) as file:
        n_poses = len(pose_rows(file.text()))
    if n_poses == len(source):
        return slice(None)
    # frames in another order than that of their names cannot be told from those left out
    if n_poses != len(every) or [every[number] for number in kept] != list(source.names):
        raise PoseError(
            f"has {n_poses} poses for the {len(source)} frames of {source.path}, which left out {len(left_out)} "
            f"({counts_of(left_out.values())}), expected a line for each frame, or for each and those left out "
            f"({some([*left_out])})"
        )
    return kept


def _readable(source: Source, indices: Iterable[int]) -> Iterator[Frame]:
    """The frames that can be read; others fail alone, when it is their turn."""
    for index in indices:
        with suppress(LdlsError, OSError):
            yield source[index]
