"""The frames of a source that a run takes, which of them are labelled together, and the names of their outputs."""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Mapping, Sequence
from itertools import chain
from os import PathLike
from pathlib import Path, PureWindowsPath
from typing import Any

from ldls.batch.run_tracks import TRACKS_STATE, TRACKS_TABLE
from ldls.batch.settings import RunSettings
from ldls.batch.window import Frames
from ldls.checks.values import is_whole
from ldls.datasets import Source, open_source
from ldls.errors import BatchError, ParameterError, UnsafePathError, some
from ldls.sequences.trajectory import is_gap
from ldls.viewing.formats import ENDINGS, TRACKS, file_name, file_names

WINDOWS_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}

LONGEST_NAME_BYTES = 200
"""Most file systems allow 255 bytes; ending and what marks unfinished files need some."""


def open_for_run(path: str | PathLike[str], settings: RunSettings, /, **options: Any) -> Source:  # noqa: ANN401
    """The source at a path, with what a run needs of it: no truth, and no poses where the settings bring them.

    Args:
        path: As of `open_source`, whose errors it raises.
        settings: Those of the run.
        options: As of `open_source`; they go before what the settings say.
    """
    return open_source(path, **{"truth": False, "poses": settings.poses is None, **options})


def parse_frames(text: str | None) -> slice:
    """The frames that `text` names: START:STOP:STEP, each optional, or one number; all without it.

    Raises:
        ParameterError: The text is nothing of the kind.
    """
    if text is None:
        return slice(None)
    if re.fullmatch(r"\d+", text):
        return slice(int(text), int(text) + 1)
    if not re.fullmatch(r"\d*:\d*(:[1-9]\d*)?", text):
        raise ParameterError(f"frames: got {text!r}, expected START:STOP:STEP such as 100:500:5, from 0")
    return slice(*(int(part) if part else None for part in text.split(":")))


def chosen_of(source: Source, frames: slice) -> Frames:
    """Number in the source and name of each of its `frames`, in its order.

    Raises:
        ParameterError: It has none of them, or they are no whole numbers, or go backwards.
    """
    step = 1 if frames.step is None else frames.step
    if not all(part is None or is_whole(part) for part in (frames.start, frames.stop, step)) or step < 1:
        raise ParameterError(
            f"frames: got {frames}, expected whole numbers and a step from 1, as in slice(100, 500, 5)"
        )
    chosen = tuple(zip(range(len(source))[frames], source.names[frames], strict=True))
    if not chosen:
        parts = [frames.start, frames.stop, *([] if frames.step is None else [frames.step])]
        asked = ":".join("" if part is None else str(part) for part in parts)
        raise ParameterError(f"frames: got {asked}, {source.path} has {len(source):,} frames, counted from 0")
    return chosen


def windows_of(chosen: Frames, stamps: Sequence[float | None], sweeps: int) -> list[Frames]:
    """The windows of frames that are labelled together: 2 `sweeps` + 1 in a row, fewer at the end and before a gap.

    A sweep more than `LONGEST_GAP_S` after the one before, or not later than it, begins a window.

    Args:
        chosen: Number in the source and name of each frame.
        stamps: Times of all frames of the source in seconds; None where it is not known, which ends no window.
        sweeps: Sweeps before and after the middle one; 0 for each frame alone.
    """
    windows: list[list[tuple[int, str]]] = []
    last: float | None = None
    for frame in chosen:
        stamp = stamps[frame[0]] if sweeps else None
        parted = last is not None and stamp is not None and (stamp <= last or is_gap(stamp - last))
        if not windows or parted or len(windows[-1]) > 2 * sweeps:
            windows.append([])
        windows[-1].append(frame)
        last = last if stamp is None else stamp
    return [tuple(window) for window in windows]


def check_names(names: Sequence[str], formats: Sequence[str]) -> None:
    """Refuse frames that would be written outside the folder or over one another.

    Args:
        names: Names of the frames.
        formats: Files of each, by the words that choose them.

    Raises:
        UnsafePathError: A name is no plain file name, or two are the same on some file systems.
    """
    seen: dict[str, str] = {}
    for name in names:
        if not _is_plain(name):
            raise UnsafePathError(
                f"frame {name!r}: expected a plain file name without separators, '..', drive or control characters"
            )
        for word in formats:
            file = _folded(file_name(name, word))
            if file in seen:
                raise UnsafePathError(
                    f"frames {seen[file]!r} and {name!r}: would be written to one file; rename one of them"
                )
            seen[file] = name


def check_places(
    folder: Path, names: Sequence[str], formats: Sequence[str], begun: Sequence[str], others: Sequence[str] = ()
) -> None:
    """Refuse to begin files where others are: an output is never an input.

    Args:
        folder: Folder of the results.
        names: Names of all frames of the source, for any of them may be added to a run.
        formats: The formats of the run.
        begun: Those that runs there have begun before, whose places are theirs.
        others: Files and folders of the run that are not a frame's and that no run there has begun.

    Raises:
        BatchError: There is a file, or a link, in the place of one.
    """
    added = [word for word in formats if word not in begun]
    if not (added or others) or not folder.is_dir():
        return
    there = {_folded(path.name) for path in folder.iterdir()}
    there -= {_folded(file_name(name, word)) for name in names for word in begun if word in ENDINGS}
    files = chain((file_name(name, word) for name in names for word in added), others)
    # the file system has the last word on which names are one
    foreign = [file for file in files if _folded(file) in there and os.path.lexists(folder / file)]
    if foreign:
        raise BatchError(
            f"{folder}: holds {some(foreign)}, which no run here wrote and the run would write over; an output is "
            "never written over an input, so give another --out"
        )


def check_apart(files: Mapping[str, Path], folder: Path, names: Sequence[str]) -> None:
    """Refuse a file of all frames in the place of one that runs, tracked or not, write there: one would be lost.

    Args:
        files: The files of all frames, by the options that name them.
        folder: Folder of the results.
        names: Names of all frames of the source.

    Raises:
        ParameterError: There is one.
    """
    of_frames = {_folded(file) for name in names for file in file_names(name)} if files else set()
    own = {folder.resolve(): {*of_frames, TRACKS_TABLE}, (folder / TRACKS).resolve(): {*of_frames, TRACKS_STATE}}
    for option, path in files.items():
        if _folded(path.name) in own.get(path.parent.resolve(), ()):
            raise ParameterError(f"{option}: {path} is the name of a file that runs write there; give another")


def _folded(file: str) -> str:
    """What two names have in common that are one to some file systems, by their case or how an accent is written."""
    return unicodedata.normalize("NFC", file.casefold())


def _is_plain(name: str) -> bool:
    return (
        name.isprintable()
        and 0 < len(name.encode()) <= LONGEST_NAME_BYTES
        and not name.startswith(".")
        and not set(name) & set('/\\:*?"<>|')
        and PureWindowsPath(name).name == name
        and name.partition(".")[0].lower() not in WINDOWS_DEVICES
    )
