"""Labels that a command compares: pairs of files, and the folders of the frames that they label."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.cloud import Points
from ldls.datasets.file_source import IMAGE_SUFFIXES
from ldls.errors import InputError, LdlsWarning, ShapeError, within
from ldls.evaluation.bound import bound_labels
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.pair import Pair, ranges_of
from ldls.io import read_camera, read_points, read_result
from ldls.io.images import read_image_size
from ldls.io.labels.kitti_objects import IMAGE_SIZE
from ldls.io.labels.label_formats import FORMATS, LabelFile, LabelFiles, read_labeling
from ldls.io.labels.labeling_npz import read_confidence_npz
from ldls.io.labels.squeezeseg import read_squeezeseg_ranges
from ldls.io.points import READERS
from ldls.io.result_npz import holds_result
from ldls.labeling import Labeling
from ldls.stages import project

POINT_ENDINGS = (*READERS, ".pcd.bin")


@dataclass(frozen=True, kw_only=True)
class FrameFolders:
    """Folders of the frames that labels are of; None where a folder is not known.

    Attributes:
        points: Folder of lidar sweeps.
        calib: Folder of KITTI calibration files.
        image: Folder of images, of which only the size is read; one that is not there is not known.
    """

    points: Path | None = None
    calib: Path | None = None
    image: Path | None = None

    def files(self, name: str) -> list[Path]:
        """The files of the frame `name` that the folders have."""
        return [
            *_there(self.points, name, POINT_ENDINGS),
            *_there(self.calib, name, (".txt",)),
            *_there(self.image, name, IMAGE_SUFFIXES),
        ]

    def read_points(self, name: str) -> Points:
        """(N, >= 3) points of the frame `name`, in metres.

        Raises:
            InputError: The folder is not known.
            FileNotFoundError: It has no such sweep.
        """
        if self.points is None:
            raise InputError(f"frame {name}: needs its points; name their folder (--points)")
        return read_points(next(_there(self.points, name, POINT_ENDINGS), self.points / f"{name}{POINT_ENDINGS[0]}"))

    def read_camera(self, name: str) -> Camera:
        """Camera of the frame `name`, with the size of its image; KITTI's usual one, and a warning, without images.

        Raises:
            InputError: The folder of calibrations is not known, or that of images has none of the frame.
            CalibrationError: The file is broken.
            FileNotFoundError: There is no such file.
        """
        if self.calib is None:
            raise InputError(f"frame {name}: needs its calibration; name the folder (--calib)")
        camera = read_camera(self.calib / f"{name}.txt", format="kitti")
        return replace(camera, image_size=self._image_size(name))

    def _image_size(self, name: str) -> tuple[int, int]:
        if self.image is None or not self.image.is_dir():
            mend = "name their folder (--image)" if self.image is None else f"put them into {self.image}"
            height, width = IMAGE_SIZE
            warnings.warn(
                f"images: their size is not known, {height} x {width} (height x width) is assumed, KITTI's usual one, "
                f"and decides which points are in view; {mend}",
                LdlsWarning,
                stacklevel=1,
            )
            return IMAGE_SIZE
        found = next(_there(self.image, name, IMAGE_SUFFIXES), None)
        if found is None:
            raise InputError(
                f"frame {name}: has no image in {self.image}, expected {name} with {', '.join(IMAGE_SUFFIXES)}; add "
                "it, or leave out the folder for KITTI's usual size"
            )
        return read_image_size(found)

    def in_view(self, name: str) -> NDArray[np.bool_] | None:
        """(N,) True for the points of the frame `name` that its camera sees; None without a calibration.

        Raises:
            LdlsError: As `read_points` and `read_camera`.
        """
        if self.calib is None:
            return None
        points, camera = self.read_points(name), self.read_camera(name)
        rows, _ = project(points, camera, image_size=camera.image_size or IMAGE_SIZE, keep_origin=True)
        seen = np.zeros(len(points), bool)
        seen[rows] = True
        return seen

    def read_labels(self, name: str, file: LabelFile) -> Labeling:
        """Labels of a file of the frame `name`.

        Raises:
            FileFormatError: The file is broken.
            InputError: Its format needs points or calibration whose folder is not known.
        """
        if not FORMATS[file.format].needs_points:
            return read_labeling(file.path, format=file.format)
        return read_labeling(
            file.path, format=file.format, points=self.read_points(name), camera=self.read_camera(name)
        )


@dataclass(frozen=True)
class Counting:
    """The points that count, of all methods alike: those that nobody says to be out of view.

    Attributes:
        methods: Files of each method by the names of frames.
        folders: What is known of the frames; with a calibration, the camera says what is in view, too.
        by: Those who left points out so far: names of methods, "the truth" and "the calibration".
    """

    methods: Mapping[str, Mapping[str, LabelFile]]
    folders: FrameFolders
    by: set[str] = field(default_factory=set)

    def restricted(self, name: str, truth: Labeling) -> Labeling:
        """The truth of the frame `name`, with all points ignored that do not count.

        Raises:
            ShapeError: A file labels another number of points.
        """
        if truth.ignored.any():
            self.by.add("the truth")
        for who, counts in self._said(name):
            if len(counts) != len(truth):
                raise ShapeError(
                    f"frame {name}: {who} has {len(counts):,} points, the truth {len(truth):,}; all must be of the "
                    "whole cloud in its order"
                )
            if not counts.all():
                self.by.add(who)
            truth = truth.restricted(counts)
        return truth

    def _said(self, name: str) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        seen = self.folders.in_view(name)
        if seen is not None:
            yield "the calibration", seen
        for method, files in self.methods.items():
            if name in files and FORMATS[files[name].format].ignores:
                yield method, ~self.folders.read_labels(name, files[name]).ignored


def _there(folder: Path | None, name: str, endings: Iterable[str]) -> Iterator[Path]:
    """The files of a frame that a folder has, with endings in small letters or in capitals."""
    if folder is not None:
        paths = (folder / f"{name}{spelt}" for ending in endings for spelt in (ending, ending.upper()))
        yield from (path for path in paths if path.exists())


def parse_place(text: str) -> tuple[Path, str | None]:
    """Path of labels, and their format where it says one: PATH or FORMAT:PATH.

    Raises:
        InputError: There is no such file or folder.
    """
    word, _, rest = text.partition(":")
    format, path = (word, Path(rest)) if word in FORMATS else (None, Path(text))
    if not path.exists():
        raise InputError(
            f"{text}: no such file or folder; expected PATH, or FORMAT:PATH with one of {', '.join(FORMATS)}"
        )
    return path, format


def read_pairs(files: Iterable[LabelFiles], counting: Counting) -> Iterator[Pair]:
    """Prediction and truth of each frame, with what is known of its points.

    There are `ranges_m` where points are given or SqueezeSeg's truth has them, and confidences in `.npz` files of ldls.

    Raises:
        FileFormatError: A file is broken.
        InputError: A format needs points or calibration whose folder is not known.
        ShapeError: Prediction and truth of a frame differ in length.
    """
    for frame in files:
        prediction = counting.folders.read_labels(frame.name, frame.prediction)
        truth = counting.folders.read_labels(frame.name, frame.truth)
        confidence = read_confidence_npz(frame.prediction.path) if frame.prediction.format == "npz" else None
        with within(frame.prediction.path):
            pair = Pair(frame.name, prediction, truth, _ranges(frame, counting.folders), confidence)
        yield replace(pair, truth=counting.restricted(frame.name, truth))


def have_masks(files: Iterable[LabelFiles]) -> bool:
    """True where every prediction is a whole result of ldls, with the masks that it came from."""
    return all(frame.prediction.format == "npz" and holds_result(frame.prediction.path) for frame in files)


def read_bounds(
    files: Sequence[LabelFiles], counting: Counting, *, classes: ClassSet, joined: set[str]
) -> Iterator[Pair]:
    """The best labels that the masks of each frame's result allow, beside its truth.

    Names of frames whose labels come from masks of other sweeps, too, go to `joined`: a result has its own alone.

    Raises:
        UnsupportedFormatError: A prediction is no whole result of ldls, of which alone the masks are known.
        LdlsError: As `read_pairs`.
    """
    for frame, pair in zip(files, read_pairs(files, counting), strict=True):
        result = read_result(frame.prediction.path)
        if result.report.n_sweeps > 1:
            joined.add(frame.name)
        names = [instance.name for instance in result.instances]
        labels = Labeling.from_instance_labels(bound_labels(result, pair.truth, classes), names)
        yield replace(pair, prediction=labels, confidence=None)


def _ranges(frame: LabelFiles, folders: FrameFolders) -> NDArray[np.floating] | None:
    if folders.points is not None:
        return ranges_of(folders.read_points(frame.name))
    if frame.truth.format == "squeezeseg":
        return read_squeezeseg_ranges(frame.truth.path)
    return None
