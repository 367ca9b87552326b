"""A plain folder of frames, described by a small file, ldls.toml."""

from __future__ import annotations

import glob
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from os import PathLike
from pathlib import Path, PurePath

from ldls.camera import Camera
from ldls.checks import checked
from ldls.checks.values import as_seconds, number_of
from ldls.datasets.file_source import FileSource, described_in, image_from_file
from ldls.datasets.folder_description import FILE, TEMPLATE, read_description
from ldls.datasets.frame import CameraImage
from ldls.datasets.stored_masks import FRAME
from ldls.errors import CalibrationError, CorruptFileError, ParameterError, SourceError, UnsafePathError, within
from ldls.io import read_camera, read_masks
from ldls.io.cameras.extrinsic_file import as_extrinsic
from ldls.io.cameras.kitti import RAW_FILES
from ldls.io.files import read_lines, strictly_below
from ldls.io.images import read_image_size
from ldls.io.masks.data_set import MaskDataSet
from ldls.masks import InstanceMasks

__all__ = ["TEMPLATE", "FolderSource"]


class FolderSource(FileSource):
    """Frames of a folder that an ldls.toml describes; `TEMPLATE` has every key.

    Attributes:
        kind: "folder".
        path: Folder of ldls.toml.
        names: Values of {frame}, sorted; numbers by their value.
        stamps: Times of the sweeps in seconds; None for each without a file of stamps.
        left_out: Parts that incomplete frames lack, by name of the frame.
        stored_masks: Place of the masks of each camera that has them, as the description names it.
        category_names: Name of each category id of each file of all masks.
    """

    kind = "folder"
    looks_for = FILE

    @checked
    def __init__(self, path: str | PathLike[str], *, allow_outside: bool = False, truth: bool = True) -> None:
        """Read the description and look for the frames.

        Args:
            path: The description, or the folder of ldls.toml.
            allow_outside: Allow paths that are absolute or lead out of the folder.
            truth: Give frames their truth, where the description names it.

        Raises:
            ParameterError: A key is unknown, missing, or of another type.
            UnsafePathError: A path leads out of the folder.
            SourceError: No frame is whole, or a stamp is missing.
            CalibrationError: A calibration cannot be a camera's.
            FileFormatError: The description or a file of stamps is broken.
            MaskError: One file of all masks contradicts itself.
            FileNotFoundError: There is no description, or a file that it names is not there.
        """
        self._file = described_in(path, FILE)
        self.path, self._allow_outside = self._file.parent, allow_outside
        self._described = read_description(self._file)
        self._cameras = self._described.cameras
        images = {f"cameras.{name}": self._find(each.images) for name, each in self._cameras.items()}
        parts = {"points": self._find(self._described.points), **images}
        super().__init__(self.path, parts, self._cameras, truth=truth, columns=self._described.columns)
        self.stamps = self._read_stamps(self._described.stamps)
        self._image_stamps = {name: self._read_stamps(each.stamps) for name, each in self._cameras.items()}
        self.stored_masks = {name: each.masks for name, each in self._cameras.items() if each.masks is not None}
        self._data_sets = {
            place: MaskDataSet(self._safe(place)) for place in set(self.stored_masks.values()) if FRAME not in place
        }
        own = [(each.stamps, each.calibration, each.T_camera_lidar, each.masks) for each in self._cameras.values()]
        self._places = dict.fromkeys(each for each in (self._described.stamps, *chain(*own)) if isinstance(each, str))
        self._shared = self._shared_files()
        self.category_names = tuple(data_set.category_names for data_set in self._data_sets.values())
        for key in self._cameras:
            self._camera(key, self.names[0])

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True for a folder with an ldls.toml, and for a TOML file."""
        return described_in(path, FILE).suffix == ".toml" and described_in(path, FILE).is_file()

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from, those of its cameras and stamps among them."""
        own = (self._one(place, self.names[index]) for place in self._places if FRAME in place)
        return (*self._shared, *super().files(index), *(path for path in own if path.exists()))

    def _shared_files(self) -> tuple[Path, ...]:
        paths = [self._safe(place) for place in self._places if FRAME not in place]
        # a calibration may be the folder of a day of KITTI raw
        paths += [path / name for path in paths if path.is_dir() for name in RAW_FILES]
        return (self._file, *(path for path in paths if path.is_file()))

    def _image(self, camera: str, index: int) -> CameraImage:
        name = self.names[index]
        path = self._parts[f"cameras.{camera}"][name]
        made = self._camera(camera, name)
        made = made if made.image_size is not None else replace(made, image_size=read_image_size(path))
        masks = self._masks(camera, name, made.image_size)
        return image_from_file(camera, path, made, stamp=self._image_stamps[camera][index], masks=masks)

    def _masks(self, camera: str, name: str, image_size: tuple[int, int] | None) -> InstanceMasks | None:
        place = self._cameras[camera].masks
        if place is None:
            return None
        if FRAME not in place:
            paths: dict[str, Path | None] = {key: self._parts[f"cameras.{key}"][name] for key in self._cameras}
            data_set = self._data_sets[place]
            return data_set.masks(data_set.find(name, camera, paths), image_size)
        stored = self._one(place, name)
        return read_masks(stored, image_size=image_size) if stored.exists() else None

    def _camera(self, key: str, name: str) -> Camera:
        each = self._cameras[key]
        given = each.T_camera_lidar
        extrinsic = self._one(given, name) if isinstance(given, str) else given
        if each.calibration is not None:
            made = read_camera(self._one(each.calibration, name), T_camera_lidar=extrinsic, **each.options)
            if made.image_size is None:
                return replace(made, image_size=each.image_size)
            if each.image_size is not None and tuple(each.image_size) != made.image_size:
                raise CalibrationError(
                    f"{self._file}, cameras.{key}: image_size is {tuple(each.image_size)}, the calibration says "
                    f"{made.image_size}; leave it out"
                )
            return made
        # the description has both where there is no file
        assert each.K is not None
        assert extrinsic is not None
        with within(f"{self._file}, cameras.{key}"):
            return Camera(
                projection=each.K,
                T_camera_lidar=as_extrinsic(extrinsic),
                distortion=each.distortion,
                image_size=each.image_size,
            )

    def _truth_files(self, name: str) -> Iterable[tuple[Path, str | None]]:
        pattern = self._described.truth
        return [] if pattern is None else [(self._one(pattern, name), self._described.truth_format)]

    def _read_stamps(self, pattern: str | None) -> tuple[float | None, ...]:
        if pattern is None:
            return (None,) * len(self.names)
        path = self._safe(pattern)
        stamps: dict[str, float] = {}
        line_of: dict[str, int] = {}
        for number, line in enumerate(read_lines(path), start=1):
            # a comment, unless a frame is called so
            if not line.strip() or (line.startswith("#") and line.rsplit(None, 1)[0] not in self.names):
                continue
            name, stamp = _stamp(path, number, line)
            if name in stamps:
                raise CorruptFileError(
                    f"{path}, line {number}: frame {name} has a stamp in line {line_of[name]} already, expected one; "
                    "remove one of these lines"
                )
            stamps[name], line_of[name] = stamp, number
        missing = [name for name in self.names if name not in stamps]
        if missing:
            others = [name for name in stamps if name not in self.names]
            found = f"; it has one of {others[0]!r}, which is no frame" if others else ""
            raise SourceError(f"{path}: has no stamp of {len(missing)} frames, the first is {missing[0]}{found}")
        return tuple(stamps[name] for name in self.names)

    def _find(self, pattern: str) -> dict[str, Path]:
        """Files of a pattern by the value of {frame} in their paths."""
        if FRAME not in pattern:
            raise ParameterError(
                f"{self._file}: {pattern!r} has no {FRAME}, expected a path such as 'lidar/{FRAME}.bin'"
            )
        self._safe(pattern.replace(FRAME, "frame"))
        pattern = PurePath(pattern).as_posix()
        before, *after = (re.escape(part) for part in pattern.split(FRAME))
        shape = re.compile(before + "(?P<frame>[^/]+)" + "(?P=frame)".join(after))
        paths = glob.glob(glob.escape(pattern).replace(FRAME, "*"), root_dir=self.path)  # noqa: PTH207 - absolute ones
        names = {matched["frame"]: path for path in paths if (matched := shape.fullmatch(Path(path).as_posix()))}
        return {name: self._safe(path) for name, path in sorted(names.items())}

    def _one(self, pattern: str, name: str) -> Path:
        return self._safe(pattern.replace(FRAME, name))

    def _safe(self, name: str) -> Path:
        if self._allow_outside:
            return self.path / name
        try:
            return strictly_below(self.path, name, place=str(self._file))
        except UnsafePathError as error:
            mend = "" if "\0" in name else ", or pass allow_outside=True"
            raise UnsafePathError(f"{error}{mend}") from None


def _stamp(path: Path, number: int, line: str) -> tuple[str, float]:
    name, *words = line.rsplit(None, 1)
    try:
        seconds = number_of("".join(words))
    except ValueError:
        seconds = math.nan
    if not name or math.isnan(seconds):
        raise CorruptFileError(f"{path}, line {number}: expected 'frame seconds', got {line[:80]!r}")
    return name.strip(), as_seconds(f"{path}, line {number}: stamp", seconds, CorruptFileError)
