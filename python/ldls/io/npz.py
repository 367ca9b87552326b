"""NumPy archives, opened with care."""

from __future__ import annotations

import lzma
import zipfile
import zlib
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, FileFormatError, LimitError
from ldls.io.npy import read_array
from ldls.io.regular_file import regular_file
from ldls.io.whole_file import whole_file

MAX_BYTES = 4 << 30
"""Unpacked size up to which an archive is loaded."""
MAX_MEMBERS = 1000


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
