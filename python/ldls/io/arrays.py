"""NumPy's `.npy` and `.npz` files, opened with care."""

from __future__ import annotations

import lzma
import math
import tokenize
import zipfile
import zlib
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, FileFormatError, LimitError, TruncatedFileError, UnsafeFileError, within
from ldls.io.files import regular_file, whole_file

MAX_BYTES = 4 << 30
"""Unpacked size up to which an archive is loaded."""
MAX_MEMBERS = 1000


def read_npy(path: str | PathLike[str]) -> NDArray[Any]:
    """The array of an `.npy` file.

    Raises:
        FileFormatError: It is not a whole `.npy` file, or holds Python objects.
    """
    path = regular_file(path)
    with within(path), path.open("rb") as file:
        return read_array(file, path.stat().st_size)


def read_array(file: IO[bytes], n_bytes: int) -> NDArray[Any]:
    """The array of an open file or archive member of `n_bytes`; nothing is allocated for bytes that are not there.

    Raises:
        UnsafeFileError: It holds Python objects.
        TruncatedFileError: It ends before its array does.
        CorruptFileError: It is no `.npy` file.
    """
    if n_bytes == 0:
        raise CorruptFileError("not a whole .npy file: got an empty one")
    try:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read_header(file)
        if dtype.hasobject:
            raise UnsafeFileError("object arrays are not loaded")
        # an entry of no bytes, as dtype U0 has it, counts as one: there could be any number of them
        expected = file.tell() + math.prod(shape) * max(dtype.itemsize, 1)
        if expected > n_bytes:
            raise TruncatedFileError(f"shape {shape} of {dtype} needs {expected} bytes, got {n_bytes}")
        file.seek(0)
        return np.asarray(npy.read_array(file, allow_pickle=False))
    except FileFormatError:
        raise
    except (ValueError, TypeError, SyntaxError, EOFError, tokenize.TokenError) as error:
        raise CorruptFileError(f"not a whole .npy file ({error})") from None


def read_npz(path: str | PathLike[str]) -> dict[str, NDArray[Any]]:
    """The arrays of an `.npz` file by name.

    Raises:
        CorruptFileError: It is not a whole `.npz` file.
        UnsafeFileError: It holds Python objects.
        LimitError: It would unpack to more than `MAX_BYTES` or more than `MAX_MEMBERS` arrays.
    """
    path = regular_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            _check_size(path, archive.infolist())
            return {member.filename.removesuffix(".npy"): _read_member(archive, member) for member in members}
    except FileFormatError as error:
        raise type(error)(f"{path}: {error}") from None
    except (FileNotFoundError, PermissionError):
        raise
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, RuntimeError, ValueError) as error:
        raise CorruptFileError(f"{path}: not a whole .npz file ({error})") from None


def _read_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(member) as file:
        return read_array(file, member.file_size)


def write_npz(path: str | PathLike[str], arrays: dict[str, NDArray[Any]]) -> None:
    """Write a compressed `.npz` file."""
    with whole_file(path) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _check_size(path: Path, members: list[zipfile.ZipInfo]) -> None:
    unpacked = sum(member.file_size for member in members)
    if len(members) > MAX_MEMBERS or unpacked > MAX_BYTES:
        raise LimitError(
            f"{path}: unpacks to {len(members)} arrays of {unpacked} bytes, "
            f"expected at most {MAX_MEMBERS} and {MAX_BYTES}"
        )
