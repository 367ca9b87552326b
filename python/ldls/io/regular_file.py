"""Files that end: what is neither a folder nor a pipe nor a device."""

from __future__ import annotations

import stat
from os import PathLike
from pathlib import Path

from ldls.errors import FileFormatError

KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def regular_file(path: str | PathLike[str]) -> Path:
    """`path`, which is a regular file.

    Raises:
        FileFormatError: It is a folder, a pipe or a device.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode):
        found = next((name for is_kind, name in KINDS if is_kind(mode)), "something else")
        raise FileFormatError(f"{path}: expected a regular file, got {found}")
    return path
