"""Stamps as KITTI's data sets have them: a line a frame."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ldls.errors import CorruptFileError, SourceError
from ldls.io.files import read_lines

CLOCK_EXAMPLE = "2011-09-26 13:02:25.951199337"
"""A line of KITTI's raw data."""
CLOCK = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(\.\d{1,9})?", re.ASCII)


def read_stamps(
    path: Path, names: Sequence[str], seconds: Callable[[str], float | None], *, example: str
) -> tuple[float | None, ...]:
    """Time of each frame in seconds; a line of the file is that of the frame of its number. None without the file.

    Args:
        path: File of a time a line.
        names: Names of the frames.
        seconds: The time of a line.
        example: A line, for messages.

    Raises:
        SourceError: There are fewer lines than frames, or a name is no number.
        CorruptFileError: A line holds no time.
    """
    if not path.exists():
        return (None,) * len(names)
    lines = read_lines(path)
    stamps = []
    for name in names:
        if not name.isdecimal():
            raise SourceError(f"{path}: frame {name!r} is no number, which its line would be")
        if len(lines) <= int(name):
            raise SourceError(f"{path}: has {len(lines)} stamps, expected one for each frame up to {names[-1]}")
        try:
            stamps.append(seconds(lines[int(name)]))
        except (ValueError, OverflowError):
            line = lines[int(name)]
            raise CorruptFileError(
                f"{path}, line {int(name) + 1}: expected a time such as {example}, got {line[:80]!r}"
            ) from None
    return tuple(stamps)


def clock_seconds(line: str) -> float | None:
    """Seconds since 1970; None for a blank line, which KITTI has for what was not taken."""
    if not line.strip():
        return None
    # NumPy takes zones and other spellings too, some of them with a warning
    if not CLOCK.fullmatch(line.strip()):
        raise ValueError("not a time")
    stamp = np.datetime64(line.strip(), "ns")
    return int(stamp.astype(np.int64)) / 1e9
