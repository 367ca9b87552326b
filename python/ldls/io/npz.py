"""NumPy archives, opened with care."""

from __future__ import annotations

import zipfile
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, LimitError, UnsafeFileError
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
    path = Path(path)
    try:
        _check_size(path)
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (zipfile.BadZipFile, EOFError, KeyError, OSError) as error:
        if isinstance(error, FileNotFoundError | PermissionError | IsADirectoryError):
            raise
        raise CorruptFileError(f"{path}: not a whole .npz file ({error})") from None
    except ValueError as error:
        if "allow_pickle" in str(error):
            raise UnsafeFileError(f"{path}: object arrays are not loaded") from None
        raise CorruptFileError(f"{path}: not a whole .npz file ({error})") from None


def write_npz(path: str | PathLike[str], arrays: dict[str, NDArray[Any]]) -> None:
    """Write a compressed `.npz` file."""
    with whole_file(path) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def _check_size(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    unpacked = sum(member.file_size for member in members)
    if len(members) > MAX_MEMBERS or unpacked > MAX_BYTES:
        raise LimitError(
            f"{path}: unpacks to {len(members)} arrays of {unpacked} bytes, "
            f"expected at most {MAX_MEMBERS} and {MAX_BYTES}"
        )
