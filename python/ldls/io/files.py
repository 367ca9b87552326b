"""Files read and written with care: through one door, whole or not there, and below the folder they are named in."""

from __future__ import annotations

import errno
import hashlib
import io
import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ldls.errors import (
    CorruptFileError,
    FileFormatError,
    InputError,
    LdlsError,
    LimitError,
    TruncatedFileError,
    UnsafePathError,
    within,
)

UNFINISHED = ".ldls-part"
"""Ending of the names of files that are being written."""
MAX_BYTES = 4 << 30
"""Largest file that is read where its reader states no limit of its own."""
MAX_TEXT_BYTES = 1 << 30
MAX_POINT_BYTES = 1 << 16
"""Most bytes of a point in a file that says itself how many there are."""
LARGE_BYTES = 1 << 28
"""Of files that are to be smaller than this, a larger one is none."""
DIGEST_BLOCK_BYTES = 1 << 16
"""Allocators use larger ones once and then keep them."""
KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)
# a pipe without a writer is opened at once, to be refused; no terminal becomes the process's own
FLAGS = os.O_RDONLY | sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_NOCTTY", "O_BINARY"))
LIES = (None, errno.EINVAL, errno.EOVERFLOW)
"""Numbers of errors of the system that come of places that a file names and does not have, or of libraries alone."""


class InputFile(io.BufferedReader):
    """A regular file open for reading; `open_file` opens it.

    Attributes:
        path: Where it lies, for libraries that insist on opening it themselves.
        size: Bytes that it had when it was opened.
    """

    def __init__(self, path: Path, descriptor: int, size: int) -> None:
        """The file behind an open descriptor."""
        super().__init__(io.FileIO(descriptor, "rb"))
        self.path, self.size = path, size

    def read(self, size: int | None = -1, /) -> bytes:
        """The next `size` bytes, or all; never more than there were when the file was opened.

        Nothing is allocated for bytes that are not there, and a file that grows comes to an end.

        Raises:
            TruncatedFileError: The file has become shorter since.
        """
        left = max(self.size - self.tell(), 0)
        wanted = left if size is None or size < 0 else min(size, left)
        content = super().read(wanted)
        if len(content) < wanted:
            raise self._shrunk()
        return content

    def array(self) -> NDArray[np.uint8]:
        """What is left of the file as an array that can be written to, without a copy; errors as of `read`."""
        content = np.empty(max(self.size - self.tell(), 0), np.uint8)
        if self.readinto(content.data) < len(content):
            raise self._shrunk()
        return content

    def _shrunk(self) -> TruncatedFileError:
        return TruncatedFileError(
            f"ends at byte {self.tell()}, it had {self.size} when it was opened; read it when nobody writes to it"
        )

    def text(self) -> str:
        """What is left of the file as text in UTF-8, with or without a byte order mark.

        Raises:
            CorruptFileError: It is not text.
        """
        try:
            return self.read().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise CorruptFileError(f"not a text file ({error.reason} at byte {error.start})") from None


@contextmanager
def open_file(path: str | PathLike[str], what: str, *, limit: int = MAX_BYTES) -> Iterator[InputFile]:
    """The file `path`, opened to be read and parsed in the block: the one door through which files come in.

    Errors of `ldls` that leave the block begin with the path; whatever else fails in it makes a `CorruptFileError`,
    as `parsing` says.

    Args:
        path: The file.
        what: What it should be, for messages, as "image".
        limit: Most bytes that such a file may have.

    Raises:
        FileFormatError: It is a folder, a pipe, a socket or a device.
        LimitError: It has more bytes than `limit`.
        CorruptFileError: What the block calls cannot read it.
        UnsafePathError: It is no path that the system knows, as one with a NUL.
        OSError: It is not there, or the system cannot read it.
    """
    path = Path(path)
    with within(path), names_file(path), opened(path, what, limit=limit) as file, parsing(what):
        yield file


@contextmanager
def parsing(what: str) -> Iterator[None]:
    """Make a `CorruptFileError` of any failure within, panics included: whatever parsers raise has nothing in common.

    Errors of `ldls`, of the system, lack of memory, libraries that are not there, warnings and all that ends a program
    pass as they are.
    """
    try:
        yield
    except (LdlsError, MemoryError, ImportError, Warning):
        raise
    except BaseException as error:
        # PanicException of Rust libraries is no Exception, and each of them has its own
        foreign = isinstance(error, Exception) or type(error).__name__ == "PanicException"
        if not foreign or (isinstance(error, OSError) and error.errno not in LIES):
            raise
        raise CorruptFileError(f"not a whole {what} ({type(error).__name__}: {str(error)[:200]})") from error


def opened(path: Path, what: str, *, limit: int) -> InputFile:
    """The file `path`, for a library that reads it longer than a block lasts; errors as of `open_file`, unnamed."""
    try:
        descriptor = os.open(path, FLAGS)
    except ValueError as error:
        raise UnsafePathError(f"no path of a file ({error})") from None
    except OSError:
        with suppress(OSError):
            _check_regular(path.stat().st_mode)  # no socket is opened, and on Windows no folder
        raise
    try:
        status = os.fstat(descriptor)
        _check_regular(status.st_mode)
        if status.st_size > limit:
            mend = "split it" if limit >= LARGE_BYTES else "is it one?"
            raise LimitError(f"{status.st_size:,} bytes, expected at most {limit:,} of a {what}; {mend}")
        return InputFile(path, descriptor, status.st_size)
    except BaseException:
        os.close(descriptor)
        raise


def _check_regular(mode: int) -> None:
    if not stat.S_ISREG(mode):
        kind = next((name for is_kind, name in KINDS if is_kind(mode)), "something else")
        raise FileFormatError(f"expected a regular file, got {kind}")


def read_lines(path: str | PathLike[str], what: str = "text file", *, limit: int = MAX_TEXT_BYTES) -> list[str]:
    """The lines of a text file without their ends; the blank ones at its end are left out.

    Raises:
        CorruptFileError: It is not text.
        FileFormatError: It is no regular file.
        LimitError: It has more bytes than `limit`.
    """
    with open_file(path, what, limit=limit) as file:
        return file.text().rstrip().splitlines()


@contextmanager
def names_file(path: str | PathLike[str]) -> Iterator[None]:
    """Give errors of the system the name of the file, which those of writing and syncing lack."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise


def check_folder(path: str | PathLike[str]) -> None:
    """Refuse a file whose folder is not there.

    Raises:
        FileNotFoundError: It is not.
    """
    folder = Path(path).parent
    if not folder.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder to write to; make it first", str(folder))


def make_folder(path: Path) -> None:
    """Make a folder, and those that it is to be in, where they are not there.

    Raises:
        UnsafePathError: It, or one that it is to be in, is a link that leads nowhere.
        OSError: There is a file of this name, or the system makes none.
    """
    dangling = next((each for each in (path, *path.parents) if each.is_symlink() and not each.exists()), None)
    if dangling is not None:
        raise UnsafePathError(
            f"{dangling}: is a link that leads nowhere (to {dangling.readlink()}), expected a folder or none; make "
            "what it leads to, or remove the link"
        )
    path.mkdir(parents=True, exist_ok=True)


def check_outputs(
    outputs: Mapping[str, Iterable[Path | None]],
    inputs: Iterable[str | PathLike[str] | None],
    *,
    made: Path | None = None,
) -> None:
    """Refuse, before any work, to write where no folder is, over what is read, or one output over another.

    An output is never an input. Links, relative paths and letters of another case name the file that they lead to.

    Args:
        outputs: The files that will be written, by the option that names them; they need not be there. None is passed
            over.
        inputs: The files that are read; of a folder, those in it. None is passed over.
        made: The folder that is made for them if need be.

    Raises:
        FileNotFoundError: The folder of one of `outputs` is not there.
        InputError: One of `outputs` is one of `inputs`, or that of two options.
    """
    written = [(option, path) for option, paths in outputs.items() for path in paths if path is not None]
    to_be = [] if made is None else [made.resolve(), *made.resolve().parents]
    for folder, path in {path.parent: path for _, path in written}.items():
        if folder.resolve() not in to_be:
            check_folder(path)
    options: dict[Path, str] = {}
    for option, path in written:
        other = options.setdefault(path.resolve(), option)
        if other != option:
            raise InputError(f"{option}: {path} is what {other} writes, too; give another")
    there = {_identity(path): (option, path) for option, path in written if path.exists()}
    # nearly always nothing is there, and the inputs, which may be many, are not looked at
    given = (Path(path) for path in inputs if path is not None) if there else ()
    for path in (path for each in given for path in (each.iterdir() if each.is_dir() else [each]) if path.exists()):
        if _identity(path) in there:
            option, output = there[_identity(path)]
            raise InputError(f"{option}: would write over {output}, which is an input ({path}); give another")


def _identity(path: Path) -> tuple[int, int]:
    """What tells a file from all others of the system."""
    status = path.stat()
    return status.st_dev, status.st_ino


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[IO[bytes]]:
    """A file to write to that takes the place of `path` when the block ends, and leaves no trace if it fails.

    Raises:
        FileFormatError: There is a folder of that name.
        FileNotFoundError: There is no such folder to write to.
    """
    target = Path(path)
    check_folder(target)
    if target.is_dir():
        raise FileFormatError(f"{target}: expected a file to write to, got a folder; name another")
    # beside the target, for only within one file system is a file renamed at a stroke; without its name, which may be
    # as long as names can be
    temporary = target.with_name(f".{secrets.token_hex(8)}{UNFINISHED}")
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
    with open_file(path, "file") as file:
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
        with within(path):
            _check_regular(path.stat().st_mode)
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


def remove_unfinished(folder: str | PathLike[str]) -> None:
    """Remove the files that killed processes left unfinished in `folder`."""
    # the folder is read to its end before it is changed
    for path in list(Path(folder).glob(f".*{UNFINISHED}")):
        path.unlink(missing_ok=True)


def folder_hint(folder: str | PathLike[str], *beginnings: str, option: str = "") -> str:
    """The end of a message that a folder has no such files: which folder in it may be meant; empty where there is none.

    Args:
        folder: The folder.
        beginnings: How names of folders with such files begin.
        option: What takes it, as "masks=".
    """
    folder = Path(folder)
    inside = sorted(folder.iterdir()) if folder.is_dir() else []
    likely = next((path for path in inside if path.name.startswith(beginnings) and path.is_dir()), None)
    return "" if likely is None else f"; perhaps {option}{likely}?"


def below(folder: Path, name: str, *, place: str) -> Path:
    """The path `name` below `folder`; links that lie there may lead on, for whoever put them there meant them to.

    Args:
        folder: Where it must lie.
        name: The relative path, with slashes.
        place: Where the name was read, for messages.

    Raises:
        UnsafePathError: The path is absolute, climbs out with `..`, holds a NUL, or is empty.
    """
    absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).is_absolute() or PureWindowsPath(name).drive
    if not name or "\0" in name:
        raise UnsafePathError(f"{place}: path {name!r} names no file; expected a path below {folder}")
    if absolute or ".." in PureWindowsPath(name).parts:
        raise UnsafePathError(f"{place}: path {name!r} leads out of {folder}; expected a path below it")
    return folder / name


def strictly_below(folder: Path, name: str, *, place: str) -> Path:
    """As `below`, and without links that lead out.

    Raises:
        UnsafePathError: The path, its links followed, does not lie below `folder`.
    """
    path = below(folder, name, place=place)
    if not path.resolve().is_relative_to(folder.resolve()):
        raise UnsafePathError(
            f"{place}: path {name!r} leads by a link to {path.resolve()}, out of {folder}; copy it there"
        )
    return path
