"""NumPy's `.npy` and `.npz` files, opened with care."""

from __future__ import annotations

import io
import math
import threading
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ldls.errors import (
    CorruptFileError,
    LdlsError,
    LimitError,
    TruncatedFileError,
    UnsafeFileError,
    UnsupportedFormatError,
    within,
)
from ldls.io.files import MAX_BYTES, InputFile, open_file, whole_file

MAX_MEMBERS = 1000
MAX_DIRECTORY_BYTES = 1 << 20
"""Longest list of an archive's members."""
HEADER_BYTES = 1 << 14
"""Bytes that the header of an array lies in."""
CHUNK_BYTES = 1 << 20
LEVEL = 1
"""How hard arrays are compressed: a third of the time of 6, which is NumPy's, and 3 % larger."""
SAMPLE_BYTES = 1 << 14
"""Bytes at the beginning of an array that tell whether it is worth compressing."""
PLAIN_BYTES = 1 << 28
"""Size up to which an array may be packed as well as it likes: masks without a pixel are."""
MAX_RATIO = 700
"""Larger arrays unpack to at most so many times the bytes of their archive; 40 masks of ellipses reach 650."""
DEFLATE_RATIO = 1032
"""Nothing unpacks to more than so many times its size."""
BEST_RATIOS = {zipfile.ZIP_STORED: 1, zipfile.ZIP_DEFLATED: DEFLATE_RATIO}
"""The ways of packing that NumPy has, and how many times its size what they pack can have at most."""
LISTED = 20
_parsing_header = threading.Lock()
"""NumPy parses headers as Python, of which CPython 3.11 confuses those of two threads."""
KINDS = "biufU"
"""Kinds of the arrays that are read: flags, numbers and text."""


def read_npy(path: str | PathLike[str]) -> NDArray[Any]:
    """The array of an `.npy` file.

    Raises:
        FileFormatError: It is not a whole `.npy` file, or holds Python objects.
        LimitError: It has more than `MAX_BYTES`.
    """
    with open_file(path, ".npy file") as file:
        return _read_array(file, file.size)


class Archive(Mapping[str, NDArray[Any]]):
    """The arrays of an open `.npz` file by name; each is unpacked when it is asked for, and no other."""

    def __init__(self, archive: zipfile.ZipFile, n_bytes: int) -> None:
        """The arrays of an archive that has `n_bytes`.

        Raises:
            LimitError: It would unpack to more than `MAX_BYTES` or more than `MAX_MEMBERS` arrays.
        """
        self._archive, self._n_bytes = archive, n_bytes
        members = archive.infolist()
        self._members = {each.filename.removesuffix(".npy"): each for each in members if each.filename[-4:] == ".npy"}
        unpacked = sum(member.file_size for member in members)
        if len(members) > MAX_MEMBERS or unpacked > MAX_BYTES:
            raise LimitError(
                f"unpacks to {len(members)} arrays of {unpacked} bytes, expected at most {MAX_MEMBERS} and {MAX_BYTES}"
            )

    def __getitem__(self, name: str) -> NDArray[Any]:
        member = self._members[name]
        with within(member.filename):
            self._check(member)
            with self._archive.open(member) as file:
                return _read_array(file, member.file_size, KINDS)

    def __contains__(self, name: object) -> bool:
        return name in self._members  # what Mapping has would unpack it

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def listed(self) -> str:
        """The first of their names in order, for messages."""
        return str(sorted(self._members)[:LISTED])

    def _check(self, member: zipfile.ZipInfo) -> None:
        packed, unpacked = member.compress_size, member.file_size
        if member.compress_type not in BEST_RATIOS:
            raise UnsupportedFormatError(f"packed by method {member.compress_type}; write it by numpy.savez_compressed")
        if unpacked > BEST_RATIOS[member.compress_type] * packed:
            raise CorruptFileError(f"{packed:,} bytes cannot unpack to {unpacked:,}")
        if unpacked > max(PLAIN_BYTES, MAX_RATIO * self._n_bytes):
            raise UnsafeFileError(
                f"unpacks from {packed:,} bytes to {unpacked:,}, expected at most {MAX_RATIO} times the "
                f"{self._n_bytes:,} bytes of the file; if it is meant so, write it by numpy.savez"
            )


@contextmanager
def open_npz(path: str | PathLike[str], what: str = ".npz file") -> Iterator[Archive]:
    """The arrays of an `.npz` file, to be taken in the block, which is as that of `open_file`.

    Args:
        path: The file.
        what: What it should be, for messages.

    Raises:
        CorruptFileError: It is not a whole `.npz` file.
        UnsafeFileError: An array holds Python objects, or is far larger than the file.
        LimitError: The file or what it unpacks to has more than `MAX_BYTES`, or it has more than `MAX_MEMBERS` arrays.
    """
    with open_file(path, what) as file, zipfile.ZipFile(_Directory(file)) as archive:
        yield Archive(archive, file.size)


def write_npz(path: str | PathLike[str], arrays: dict[str, NDArray[Any]]) -> None:
    """Write a `.npz` file; arrays that get half as large and less are compressed."""
    with whole_file(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as archive:
        for name, array in arrays.items():
            # what is opened by name is compressed, by a description of its own stored as it stands
            entry = f"{name}.npy" if _shrinks(array) else zipfile.ZipInfo(f"{name}.npy")
            with archive.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)


def _shrinks(array: NDArray[Any]) -> bool:
    """True if an array gets half as large and less, going by its beginning.

    Coordinates do not, and would take most of the time of a frame.
    """
    beginning = array.ravel()[: SAMPLE_BYTES // max(array.itemsize, 1)].tobytes()
    return 2 * len(zlib.compress(beginning, LEVEL)) <= len(beginning)


class _Directory:
    """A file as `ZipFile` takes it, which reads the list of members at once, however long: here it has an end."""

    def __init__(self, file: InputFile) -> None:
        self.seek, self.tell, self.seekable = file.seek, file.tell, file.seekable
        self._read = file.read

    def read(self, size: int = -1) -> bytes:
        if size > MAX_DIRECTORY_BYTES:
            raise LimitError(f"a list of members of {size:,} bytes, expected at most {MAX_DIRECTORY_BYTES:,}")
        return self._read(MAX_DIRECTORY_BYTES if size < 0 else size)


def _read_array(file: IO[bytes], n_bytes: int, kinds: str | None = None) -> NDArray[Any]:
    """The array of an open file or archive member of `n_bytes`; nothing is allocated for bytes that are not there.

    Raises:
        UnsafeFileError: It holds Python objects.
        TruncatedFileError: It ends before its array does.
        CorruptFileError: It is no `.npy` file, or not of one of `kinds`.
    """
    if n_bytes == 0:
        raise CorruptFileError("not a whole .npy file: got an empty one")
    shape, in_columns, dtype, start = _read_header(file.read(HEADER_BYTES))
    if dtype.hasobject:
        raise UnsafeFileError("object arrays are not loaded")
    if kinds is not None and dtype.kind not in kinds:
        raise CorruptFileError(f"array of {dtype}, expected flags, numbers or text")
    if min(shape, default=0) < 0:
        raise CorruptFileError(f"not a whole .npy file: shape {shape}")
    # an entry of no bytes, as dtype U0 has it, counts as one: there could be any number of them
    count = math.prod(shape)
    expected = start + count * max(dtype.itemsize, 1)
    if expected > n_bytes:
        raise TruncatedFileError(f"shape {shape} of {dtype} needs {expected} bytes, got {n_bytes}")
    file.seek(start)
    content = np.empty(count * dtype.itemsize, np.uint8)
    for at in range(0, len(content), CHUNK_BYTES):
        part = content[at : at + CHUNK_BYTES].data
        got = file.readinto(part)  # type: ignore[attr-defined]
        if got < len(part):
            raise TruncatedFileError(f"shape {shape} of {dtype} needs {expected} bytes, got {start + at + got}")
    array = content.view(dtype) if dtype.itemsize else np.empty(count, dtype)
    return array.reshape(shape, order="F" if in_columns else "C")


def _read_header(start: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, whether columns come first, type, and where the array begins, by the first bytes of an `.npy` file."""
    head = io.BytesIO(start)
    try:
        with _parsing_header:
            version = npy.read_magic(head)
            read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            return (*read_header(head), head.tell())
    except LdlsError:
        raise
    except (Exception, MemoryError) as error:  # the parser of Python calls too many brackets a lack of memory
        raise CorruptFileError(f"not a whole .npy file ({error})") from None
