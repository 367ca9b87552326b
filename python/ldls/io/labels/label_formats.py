"""Every format that labels can be read from, and the files of labels in folders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

from numpy.typing import ArrayLike

from ldls.camera import Camera
from ldls.checks import choice
from ldls.errors import InputError, UnsupportedFormatError, some
from ldls.io.files import folder_hint, open_file
from ldls.io.labels.annotations import is_annotation, read_annotations
from ldls.io.labels.kitti_objects import is_kitti_object, read_kitti_boxes
from ldls.io.labels.labeling_npz import read_labeling_npz
from ldls.io.labels.nuscenes_labels import read_lidarseg, read_panoptic
from ldls.io.labels.semantic_kitti import read_semantic_kitti
from ldls.io.labels.squeezeseg import read_squeezeseg
from ldls.io.names import is_hidden, name_order
from ldls.labeling import Labeling


@dataclass(frozen=True)
class Format:
    """A format of labels.

    Attributes:
        ending: End of its files' names; the rest is the name of the frame.
        read: Reader of a file.
        needs_points: True where the reader needs the frame's points and camera.
        ignores: True where a file can say that points do not count, as those out of view.
        has_line: True for a line of such a file, where several formats have its ending.
    """

    ending: str
    read: Callable[..., Labeling]
    needs_points: bool = False
    ignores: bool = False
    has_line: Callable[[str], bool] = lambda line: False


FORMATS: dict[str, Format] = {
    "npz": Format(".npz", read_labeling_npz, ignores=True),
    "panoptic": Format("_panoptic.npz", read_panoptic),
    "label": Format(".label", read_semantic_kitti),
    "lidarseg": Format("_lidarseg.bin", read_lidarseg),
    "squeezeseg": Format(".npy", read_squeezeseg, ignores=True),
    "kitti-boxes": Format(".txt", read_kitti_boxes, needs_points=True, ignores=True, has_line=is_kitti_object),
    "annotations": Format(".txt", read_annotations, has_line=is_annotation),
}
"""Formats by name. Of a frame in several the first is read: those that know more, as instances, come before others, and
KITTI's lines, whose class may be a number, before annotations, which begin with one."""

SAY_WHICH = "say which by format="
LISTED = 10
"""Number of frames that an error lists."""
LONGEST_LINE_BYTES = 1 << 12


@dataclass(frozen=True)
class LabelFile:
    """A file of labels.

    Attributes:
        path: The file.
        format: Its format, one of `FORMATS`.
    """

    path: Path
    format: str


def read_labeling(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    points: ArrayLike | None = None,
    camera: Camera | None = None,
) -> Labeling:
    """Return the labels of a file.

    Args:
        path: The file.
        format: One of `FORMATS`; by default the one that the file's ending tells, or else its first line.
        points: (N, >= 3) the frame's points, which KITTI boxes need.
        camera: The frame's camera, which KITTI boxes need.

    Raises:
        UnsupportedFormatError: Neither the ending nor the first line tells the format.
        ParameterError: There is no such format.
        InputError: Points or camera are needed and missing.
        FileFormatError: The file is broken.
        FileNotFoundError: There is no such file.
    """
    name = guess_format(path) if format is None else choice("format", format, FORMATS)
    chosen = FORMATS[name]
    if not chosen.needs_points:
        return chosen.read(path)
    if points is None or camera is None:
        missing = "points" if points is None else "camera"
        raise InputError(f"{missing}: {path} holds boxes ({name}), whose points take points and camera to find")
    return chosen.read(path, points=points, camera=camera)


def guess_format(*paths: str | PathLike[str]) -> str:
    """Name of the format of files of one kind, by the ending of the first; where several have it, by their first lines.

    Raises:
        UnsupportedFormatError: No format has this ending, or several have and no line tells which it is.
        FileNotFoundError: A file whose first line is asked for is not there.
    """
    ending = _ending(Path(paths[0]).name)
    fitting = [key for key, each in FORMATS.items() if each.ending == ending]
    if not fitting:
        known = ", ".join(f"{key} (*{each.ending})" for key, each in FORMATS.items())
        raise UnsupportedFormatError(f"{paths[0]}: no format of labels has this name; expected {known}; {SAY_WHICH}")
    if len(fitting) == 1:
        return fitting[0]
    # a frame without objects has an empty file, and the next one tells
    lines = (line for path in paths if (line := _first_line(path)))
    told = next((key for line in lines for key in fitting if FORMATS[key].has_line(line)), None)
    if told is None:
        raise UnsupportedFormatError(f"{paths[0]}: may be {' or '.join(fitting)}; {SAY_WHICH}")
    return told


def _first_line(path: str | PathLike[str]) -> str:
    with open_file(path, "text file") as file:
        return file.readline(LONGEST_LINE_BYTES).decode("utf-8-sig", "replace").strip()


@dataclass(frozen=True)
class LabelFiles:
    """The files of one frame.

    Attributes:
        name: Name of the frame: that of the files without the ending.
        prediction: File of a method's labels.
        truth: File of the true labels.
    """

    name: str
    prediction: LabelFile
    truth: LabelFile


def pair_files(
    predictions: str | PathLike[str],
    truth: str | PathLike[str],
    *,
    prediction_format: str | None = None,
    truth_format: str | None = None,
    missing: Literal["error", "skip"] = "error",
) -> tuple[tuple[LabelFiles, ...], tuple[str, ...]]:
    """The frames that both sides have, in the order of `name_order`, and the names of those that only one side has.

    Two files are one frame, whatever their names. In a folder that holds a frame in several formats, the one that comes
    first in `FORMATS` is taken.

    Raises:
        InputError: A frame lacks its pair and `missing` is "error", or a side has no file of labels.
        ParameterError: There is no such format, or no such `missing`.
        FileNotFoundError: A path does not exist.
    """
    choice("missing", missing, ("error", "skip"))
    ours = label_files(predictions, prediction_format)
    theirs = label_files(truth, truth_format)
    if Path(predictions).is_file() and Path(truth).is_file():
        theirs = dict(zip(ours, theirs.values(), strict=True))
    lacking = sorted(ours.keys() ^ theirs.keys(), key=name_order)
    both = sorted(ours.keys() & theirs.keys(), key=name_order)
    if lacking and (missing == "error" or not both):
        sides = (predictions, "no truth", ours.keys() - theirs), (truth, "no prediction", theirs.keys() - ours)
        listed = "; ".join(
            f"{some(sorted(names, key=name_order), LISTED)} of {side} have {what}"
            for side, what, names in sides
            if names
        )
        raise InputError(f"frames without their pair: {listed}; add them, or skip them (--missing skip)")
    return tuple(LabelFiles(name, ours[name], theirs[name]) for name in both), tuple(lacking)


def label_files(path: str | PathLike[str], format: str | None = None) -> dict[str, LabelFile]:
    """Files of labels by the name of their frame: those of a folder, or `path` itself.

    Args:
        path: The folder, or a file.
        format: One of `FORMATS`; by default what the files' endings tell, or else their first lines.

    Raises:
        InputError: The folder holds none.
        UnsupportedFormatError: Neither ending nor first line tells the format.
        ParameterError: There is no such format.
        FileNotFoundError: There is no such path.
    """
    path = Path(path)
    wanted = list(FORMATS) if format is None else [choice("format", format, FORMATS)]
    endings = list(dict.fromkeys(FORMATS[name].ending for name in wanted))
    if path.is_file():
        ending = _ending(path.name)
        name = path.name[: -len(ending)] if ending in endings else path.stem
        return {name: LabelFile(path, format or guess_format(path))}
    files: dict[str, LabelFile] = {}
    entries = [entry for entry in sorted(path.iterdir()) if entry.is_file() and not is_hidden(entry.name)]
    for ending in endings:
        # of a_panoptic.npz the frame is a, in whatever format labels are wanted
        new = {
            entry.name[: -len(ending)]: entry
            for entry in entries
            if _ending(entry.name) == ending != entry.name.lower()
        }
        if not new.keys() - files.keys():
            continue
        try:
            of_all = format or guess_format(*new.values())
        except UnsupportedFormatError:
            if not files:
                raise
            continue  # notes beside labels
        files = {name: LabelFile(entry, of_all) for name, entry in new.items()} | files
    if not files:
        hint = folder_hint(path, "annotations", "label")
        raise InputError(f"{path}: holds no labels, expected files that end in {', '.join(endings)}{hint}")
    return files


def _ending(name: str) -> str:
    """The longest ending of a format that a name has; empty where it has none."""
    fitting = (each.ending for each in FORMATS.values() if name.lower().endswith(each.ending))
    return max(fitting, key=len, default="")
