"""Point clouds from files."""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import MAX_COLUMNS, Points, as_points
from ldls.errors import (
    CorruptFileError,
    FileFormatError,
    InputError,
    ParameterError,
    RecoveredFileWarning,
    TruncatedFileError,
    UnsafeFileError,
    UnsupportedFormatError,
)
from ldls.io.regular_file import regular_file

FLOAT_BYTES = 4


def read_points(path: str | PathLike[str], *, columns: int | None = None, recover: bool = False) -> Points:
    """(N, columns) points, x y z first, in metres.

    Args:
        path: `.bin` (float32 little-endian rows: KITTI x y z reflectance; nuScenes `.pcd.bin` with a fifth column,
            ring) or `.npy`.
        columns: Floats a row of a `.bin` file; 4, and 5 for `.pcd.bin`, by default.
        recover: Whether a truncated `.bin` yields its whole rows and a warning instead of an error.

    Raises:
        TruncatedFileError: The size is no whole number of rows.
        FileFormatError: The rows look as if they had another number of columns.
        UnsupportedFormatError: No format has this suffix.
        FileNotFoundError: There is no such file.
    """
    path = regular_file(path)
    if path.suffix == ".npy":
        return _read_npy(path)
    if path.suffix == ".bin":
        guess = 5 if path.name.endswith(".pcd.bin") else 4
        return _read_bin(path, guess if columns is None else columns, columns is None, recover)
    raise UnsupportedFormatError(f"{path}: cannot read {path.suffix!r} files, expected .bin or .npy")


def _read_bin(path: Path, columns: int, guessed: bool, recover: bool) -> NDArray[np.float32]:
    if not 3 <= columns <= MAX_COLUMNS:
        raise ParameterError(f"columns: got {columns}, expected 3 to {MAX_COLUMNS}")
    content = path.read_bytes()
    row_bytes = FLOAT_BYTES * columns
    whole = len(content) // row_bytes * row_bytes
    if whole != len(content):
        message = (
            f"{path.name}: {len(content)} bytes is not a multiple of {row_bytes} ({columns} float32 a point); "
            f"last whole point ends at {whole}"
        )
        if not recover:
            raise TruncatedFileError(f"{message}; pass columns= or recover=True to read the whole points")
        warnings.warn(message, RecoveredFileWarning, stacklevel=4)
    values = np.frombuffer(content, "<f4", count=whole // FLOAT_BYTES)
    if guessed:
        _check_guess(path, values, columns)
    return values.reshape(-1, columns).astype(np.float32, copy=False)


def _check_guess(path: Path, values: NDArray[np.float32], columns: int) -> None:
    """Refuse four columns where the file reads as five whose last is a ring number, and the other way round."""
    other = 9 - columns
    if values.size == 0 or values.size % other:
        return
    if not _has_ring(values, columns) and _has_ring(values, other):
        raise FileFormatError(
            f"{path.name}: guessed {columns} floats a point, but with {other} the last column holds ring numbers; "
            f"pass columns={other} (or columns={columns} to insist)"
        )


def _has_ring(values: NDArray[np.float32], columns: int) -> bool:
    ring = values.reshape(-1, columns)[:, -1]
    whole = (ring == np.floor(ring)) & (ring >= 0) & (ring < 256)
    return bool(whole.all()) and columns == 5 and bool(ring.any())


def _read_npy(path: Path) -> Points:
    try:
        array = np.load(path, allow_pickle=False)
    except ValueError as error:
        if "pickle" in str(error) or "Object arrays" in str(error):
            raise UnsafeFileError(f"{path.name}: object arrays are not loaded") from None
        raise CorruptFileError(f"{path.name}: not a whole .npy file ({error})") from None
    except EOFError:
        raise CorruptFileError(f"{path.name}: expected a .npy file, got an empty one") from None
    try:
        return as_points(array)
    except InputError as error:
        raise type(error)(f"{path.name}: {error}") from None
