"""Every format that labels can be read from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike

from ldls.camera import Camera
from ldls.errors import InputError, ParameterError, UnsupportedFormatError
from ldls.evaluation.annotations import read_annotations
from ldls.evaluation.kitti_boxes import read_kitti_boxes
from ldls.evaluation.nuscenes import read_lidarseg, read_panoptic
from ldls.evaluation.results import read_results
from ldls.evaluation.semantic_kitti import read_semantic_kitti
from ldls.evaluation.squeezeseg import read_squeezeseg
from ldls.labeling import Labeling


@dataclass(frozen=True)
class Format:
    """A format of labels.

    Attributes:
        ending: How its files' names end; what stands before is the name of the frame.
        read: Reader of a file.
        needs_points: Whether the reader needs the frame's points and camera.
    """

    ending: str
    read: Callable[..., Labeling]
    needs_points: bool = False


FORMATS: dict[str, Format] = {
    "nuscenes-lidarseg": Format("_lidarseg.bin", read_lidarseg),
    "nuscenes-panoptic": Format("_panoptic.npz", read_panoptic),
    "ldls": Format(".npz", read_results),
    "semantic-kitti": Format(".label", read_semantic_kitti),
    "squeezeseg": Format(".npy", read_squeezeseg),
    "annotations": Format(".txt", read_annotations),
    "kitti-boxes": Format(".txt", read_kitti_boxes, needs_points=True),
}
"""Formats by name; longer endings come before the shorter ones that they end in."""


SAY_WHICH = "say which by format=, or by --truth-format and --prediction-format"


def read_labeling(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    points: ArrayLike | None = None,
    camera: Camera | None = None,
) -> Labeling:
    """The labels of a file.

    Args:
        path: The file.
        format: One of `FORMATS`; by default the one of the file's ending, if there is but one.
        points: (N, >= 3) the frame's points, which KITTI boxes need.
        camera: The frame's camera, which KITTI boxes need.

    Raises:
        UnsupportedFormatError: The ending tells no format, or more than one.
        ParameterError: There is no such format.
        InputError: Points or camera are needed and missing.
        FileFormatError: The file is broken.
        FileNotFoundError: There is no such file.
    """
    name = guess_format(path) if format is None else check_format(format)
    chosen = FORMATS[name]
    if not chosen.needs_points:
        return chosen.read(path)
    if points is None or camera is None:
        missing = "points" if points is None else "camera"
        raise InputError(f"{missing}: {path} holds boxes ({name}), whose points are found by points and camera")
    return chosen.read(path, points=points, camera=camera)


def guess_format(path: str | PathLike[str]) -> str:
    """Name of the format of a file, by its ending.

    Raises:
        UnsupportedFormatError: No format has this ending, or several have.
    """
    name = Path(path).name
    endings = [found.ending for found in FORMATS.values() if name.endswith(found.ending)]
    fitting = [key for key, found in FORMATS.items() if endings and found.ending == endings[0]]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise UnsupportedFormatError(f"{path}: may be {' or '.join(fitting)}; {SAY_WHICH}")
    known = ", ".join(f"{key} (*{found.ending})" for key, found in FORMATS.items())
    raise UnsupportedFormatError(f"{path}: no format of labels has this name; expected {known}; {SAY_WHICH}")


def check_format(format: str) -> str:
    """`format` if it is one.

    Raises:
        ParameterError: It is none.
    """
    if format not in FORMATS:
        raise ParameterError(f"format: got {format!r}, expected one of {', '.join(FORMATS)}")
    return format
