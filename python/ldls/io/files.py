"""Files read and written with care: regular ones only, whole or not there, and below the folder they are named in."""

from __future__ import annotations

import hashlib
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO

from ldls.errors import CorruptFileError, FileFormatError, UnsafePathError

UNFINISHED = ".ldls-part"
"""Ending of the names of files that are being written."""
DIGEST_BLOCK_BYTES = 1 << 16
"""Allocators use larger ones once and then keep them."""
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
        kind = next((name for is_kind, name in KINDS if is_kind(mode)), "something else")
        raise FileFormatError(f"{path}: expected a regular file, got {kind}")
    return path


def read_lines(path: Path) -> list[str]:
    """The lines of a text file without their ends; the blank ones at its end are left out.

    Raises:
        CorruptFileError: It is not text.
        FileFormatError: It is a folder, a pipe or a device.
    """
    try:
        text = regular_file(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise CorruptFileError(f"{path}: not a text file ({error.reason} at byte {error.start})") from None
    return text.rstrip().splitlines()


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


def digest_of(path: Path) -> str:
    """SHA-256 of the bytes of a regular file, in hexadecimal digits."""
    digest = hashlib.sha256()
    with regular_file(path).open("rb", buffering=0) as file:
        while block := file.read(DIGEST_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


def refuse_link(path: Path) -> None:
    """Refuse a link in the place of a file of ours: whoever put it there would have its target written to.

    Raises:
        UnsafePathError: It is one.
    """
    if path.is_symlink():
        raise UnsafePathError(f"{path}: is a link to {path.readlink()}, expected a plain file or none; remove the link")


def open_to_append(path: Path) -> IO[bytes]:
    """A regular file, made if need be, to read and to append to, without a buffer; links are not followed.

    Raises:
        UnsafePathError: It is a link.
        FileFormatError: It is a folder, a pipe or a device.
    """
    refuse_link(path)
    if path.exists():
        regular_file(path)
    # where a link or a pipe takes its place meanwhile, the system itself refuses it, or does not wait for it
    careful = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
    handle = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | careful, 0o666)
    return os.fdopen(handle, "ab+", buffering=0)


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


def below(folder: Path, name: str, *, place: str) -> Path:
    """The path `name` below `folder`; links that lie there may lead on, for whoever put them there meant them to.

    Args:
        folder: Where it must lie.
        name: The relative path, with slashes.
        place: Where the name was read, for messages.

    Raises:
        UnsafePathError: The path is absolute, climbs out with `..`, or holds a NUL.
    """
    absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).is_absolute() or PureWindowsPath(name).drive
    if absolute or ".." in PureWindowsPath(name).parts or "\0" in name or not name:
        raise UnsafePathError(f"{place}: path {name!r} leads out of {folder}; expected a path below it")
    return folder / name


def strictly_below(folder: Path, name: str, *, place: str) -> Path:
    """As `below`, and without links that lead out.

    Raises:
        UnsafePathError: The path, its links followed, does not lie below `folder`.
    """
    path = below(folder, name, place=place)
    if not path.resolve().is_relative_to(folder.resolve()):
        raise UnsafePathError(f"{place}: path {name!r} leads by a link to {path.resolve()}, out of {folder}")
    return path
