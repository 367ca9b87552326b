"""Labels that a command compares: pairs of files, and the folders of the frames that they label."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.cloud import Points
from ldls.errors import InputError, UnsupportedFormatError
from ldls.evaluation.bound import bound_labels
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.pair import Pair, ranges_of
from ldls.io import read_camera, read_points, read_result
from ldls.io.images import read_image_size
from ldls.io.labels.label_formats import FORMATS, LabelFiles, guess_format, read_labeling
from ldls.io.labels.labeling_npz import read_confidence_npz
from ldls.io.labels.squeezeseg import read_squeezeseg_ranges
from ldls.labeling import Labeling

POINT_ENDINGS = (".bin", ".pcd.bin", ".npy")


@dataclass(frozen=True, kw_only=True)
class FrameFolders:
    """Folders of the frames that labels are of; None where a folder is not known.

    Attributes:
        points: Folder of lidar sweeps.
        calib: Folder of KITTI calibration files.
        images: Folder of images, of which only the size is read.
    """

    points: Path | None = None
    calib: Path | None = None
    images: Path | None = None

    def read_points(self, name: str) -> Points:
        """(N, >= 3) points of the frame `name`, in metres.

        Raises:
            InputError: The folder is not known.
            FileNotFoundError: It has no such sweep.
        """
        if self.points is None:
            raise InputError(f"frame {name}: needs its points; name their folder (--points)")
        paths = [self.points / f"{name}{ending}" for ending in POINT_ENDINGS]
        return read_points(next((path for path in paths if path.exists()), paths[0]))

    def read_camera(self, name: str) -> Camera:
        """Camera of the frame `name`, with the size of its image where there is one.

        Raises:
            InputError: The folder is not known.
            CalibrationError: The file is broken.
            FileNotFoundError: There is no such file.
        """
        if self.calib is None:
            raise InputError(f"frame {name}: needs its calibration; name the folder (--calib)")
        camera = read_camera(self.calib / f"{name}.txt", format="kitti")
        image = None if self.images is None else self.images / f"{name}.png"
        return replace(camera, image_size=read_image_size(image) if image is not None and image.exists() else None)


def read_pairs(
    files: Iterable[LabelFiles],
    *,
    prediction_format: str | None = None,
    truth_format: str | None = None,
    folders: FrameFolders | None = None,
) -> Iterator[Pair]:
    """Prediction and truth of each frame, with what is known of its points.

    There are `ranges_m` where points are given or SqueezeSeg's truth has them, and confidences in `.npz` files of ldls.

    Raises:
        FileFormatError: A file is broken.
        InputError: A format needs points or calibration that `folders` does not name.
        ShapeError: Prediction and truth of a frame differ in length.
    """
    folders = folders or FrameFolders()
    for frame in files:
        points = None if folders.points is None else folders.read_points(frame.name)
        prediction = _read(frame.name, frame.prediction, prediction_format, folders, points)
        truth = _read(frame.name, frame.truth, truth_format, folders, points)
        of_ldls = (prediction_format or guess_format(frame.prediction)) == "ldls"
        confidence = read_confidence_npz(frame.prediction) if of_ldls else None
        yield Pair(frame.name, prediction, truth, _ranges(frame, truth_format, points), confidence)


def read_bounds(
    files: Sequence[LabelFiles],
    *,
    classes: ClassSet,
    prediction_format: str | None = None,
    truth_format: str | None = None,
    folders: FrameFolders | None = None,
) -> Iterator[Pair]:
    """The best labels that the masks of each frame's result allow, beside its truth.

    Raises:
        UnsupportedFormatError: A prediction is no whole result of ldls, of which alone the masks are known.
        LdlsError: As `read_pairs`.
    """
    formats = {"prediction_format": prediction_format, "truth_format": truth_format}
    for frame, pair in zip(files, read_pairs(files, folders=folders, **formats), strict=True):
        # a whole result has confidences
        if pair.confidence is None:
            raise UnsupportedFormatError(f"{frame.prediction}: holds no masks, expected a result of ldls")
        result = read_result(frame.prediction)
        names = [instance.name for instance in result.instances]
        labels = Labeling.from_instance_labels(bound_labels(result, pair.truth, classes), names)
        yield replace(pair, prediction=labels, confidence=None)


def _read(name: str, path: Path, format: str | None, folders: FrameFolders, points: Points | None) -> Labeling:
    chosen = format or guess_format(path)
    if not FORMATS[chosen].needs_points:
        return read_labeling(path, format=chosen)
    cloud = folders.read_points(name) if points is None else points
    return read_labeling(path, format=chosen, points=cloud, camera=folders.read_camera(name))


def _ranges(frame: LabelFiles, truth_format: str | None, points: Points | None) -> NDArray[np.floating] | None:
    if points is not None:
        return ranges_of(points)
    if (truth_format or guess_format(frame.truth)) == "squeezeseg":
        return read_squeezeseg_ranges(frame.truth)
    return None
