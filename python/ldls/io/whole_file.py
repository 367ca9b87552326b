"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import IO

UNFINISHED = ".ldls-part"
"""How the names of files end that are being written."""


@contextmanager
def names_file(path: str | PathLike[str]) -> Iterator[None]:
    """Gives errors of the system the name of the file, which those of writing and syncing lack."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[IO[bytes]]:
    """A file to write to that takes the place of `path` when the block ends, and leaves no trace if it fails."""
    target = Path(path)
    # beside the target, for only within one file system is a file renamed at a stroke
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(6)}{UNFINISHED}")
    try:
        with names_file(target), temporary.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def sync_folder(folder: str | PathLike[str]) -> None:
    """Wait until the names of files in `folder` are on the disk: those renamed before then survive a power cut."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except PermissionError:  # Windows opens no folders
        return
    try:
        with names_file(folder):
            os.fsync(handle)
    finally:
        os.close(handle)


def sweep(folder: str | PathLike[str]) -> int:
    """Remove what killed processes left unfinished in `folder`; how many files that were."""
    left = list(Path(folder).glob(f".*{UNFINISHED}"))
    for path in left:
        path.unlink(missing_ok=True)
    return len(left)
