"""Files that end."""

from __future__ import annotations

import stat
from os import PathLike
from pathlib import Path

from ldls.errors import FileFormatError


def regular_file(path: str | PathLike[str]) -> Path:
    """`path`, which is a file: a pipe would keep its reader waiting, a device has no end.

    Raises:
        FileFormatError: It is a folder, a pipe or a device.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    if not stat.S_ISREG(path.stat().st_mode):
        raise FileFormatError(f"{path}: expected a regular file")
    return path
