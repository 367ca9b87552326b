"""Which files of predictions and truth belong to one frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

from ldls.errors import InputError, ParameterError
from ldls.evaluation.formats import FORMATS, check_format


@dataclass(frozen=True)
class FrameFiles:
    """The files of one frame.

    Attributes:
        name: Name of the frame: that of the files without the ending.
        prediction: File of a method's labels.
        truth: File of the true labels.
    """

    name: str
    prediction: Path
    truth: Path


def pair_files(
    predictions: str | PathLike[str],
    truth: str | PathLike[str],
    *,
    prediction_format: str | None = None,
    truth_format: str | None = None,
    missing: Literal["error", "skip"] = "error",
) -> tuple[tuple[FrameFiles, ...], tuple[str, ...]]:
    """The frames that both sides have, by name, and the names of those that only one side has.

    Two files are one frame, whatever their names. In a folder that holds a frame in several formats, the one that comes
    first in `FORMATS` is taken.

    Raises:
        InputError: A frame lacks its pair and `missing` is "error", or a side has no file of labels.
        ParameterError: There is no such format, or no such `missing`.
        FileNotFoundError: A path does not exist.
    """
    if missing not in ("error", "skip"):
        raise ParameterError(f"missing: got {missing!r}, expected 'error' or 'skip'")
    ours = label_files(predictions, prediction_format)
    theirs = label_files(truth, truth_format)
    if Path(predictions).is_file() and Path(truth).is_file():
        theirs = dict(zip(ours, theirs.values(), strict=True))
    both = sorted(ours.keys() & theirs.keys())
    lacking = sorted(ours.keys() ^ theirs.keys())
    if missing == "error" or not both:
        _check_complete(predictions, truth, ours.keys() - theirs.keys(), theirs.keys() - ours.keys())
    return tuple(FrameFiles(name, ours[name], theirs[name]) for name in both), tuple(lacking)


def label_files(path: str | PathLike[str], format: str | None = None) -> dict[str, Path]:
    """Files of labels by the name of their frame: those of a folder, or `path` itself.

    Raises:
        InputError: The folder holds none.
        FileNotFoundError: There is no such path.
    """
    path = Path(path)
    wanted = list(FORMATS) if format is None else [check_format(format)]
    endings = list(dict.fromkeys(FORMATS[name].ending for name in wanted))
    if path.is_file():
        return {_frame_name(path, endings) or path.stem: path}
    files: dict[str, Path] = {}
    entries = [entry for entry in sorted(path.iterdir()) if entry.is_file() and not entry.name.startswith(".")]
    for ending in endings:
        for entry in entries:
            name = _frame_name(entry, endings)
            if name and entry.name == name + ending:
                files.setdefault(name, entry)
    if not files:
        raise InputError(f"{path}: holds no labels, expected files that end in {', '.join(endings)}")
    return files


def _frame_name(path: Path, endings: list[str]) -> str | None:
    return next((path.name.removesuffix(ending) for ending in endings if path.name.endswith(ending)), None)


def _check_complete(
    predictions: str | PathLike[str], truth: str | PathLike[str], only_ours: Iterable[str], only_theirs: Iterable[str]
) -> None:
    sides = ((predictions, "no truth", sorted(only_ours)), (truth, "no prediction", sorted(only_theirs)))
    lacking = [f"{_listed(names)} of {side} have {what}" for side, what, names in sides if names]
    if lacking:
        raise InputError(f"frames without their pair: {'; '.join(lacking)}; add them, or skip them (--missing skip)")


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:10])
    return shown if len(names) <= 10 else f"{shown} and {len(names) - 10} more"
