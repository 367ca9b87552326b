"""Rows of float32 without a header: KITTI's and nuScenes' `.bin`."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import MAX_COLUMNS
from ldls.errors import FileFormatError, ParameterError, RecoveredFileWarning, TruncatedFileError
from ldls.io.files import open_file

FLOAT_BYTES = 4
MAX_RINGS = 256
FARTHEST_M = 1e7
SMALLEST_M = 1e-20
MOST_TRIED = 16
"""Columns that a file of another layout is tried with."""
OTHER_NUMBERS = (">f4", "<f8", ">f8")
"""Numbers that other programs write, by NumPy's names."""
SAMPLED_POINTS = 256
FEWEST_SAMPLED = 32
"""Of fewer points the directions tell nothing."""
NEAR_DEG, FAR_DEG = 5.0, 15.0
"""From one point to the next a lidar turns less than the one; more than the other no lidar turns each time."""


def read(path: Path, *, columns: int | None = None, recover: bool = False) -> NDArray[np.float32]:
    """(N, columns) float32: the rows of a `.bin` file.

    Args:
        path: The file.
        columns: Floats a row; 4, and 5 for `.pcd.bin`, by default.
        recover: True if a truncated file yields its whole rows and a warning instead of an error.

    Raises:
        TruncatedFileError: The file is empty, or its size is no whole number of rows.
        FileFormatError: The rows look as if they had another number of columns or were not of little-endian float32.
        ParameterError: `columns` is out of range.
    """
    guessed = columns is None
    if columns is None:
        columns = 5 if path.name.lower().endswith(".pcd.bin") else 4
    if not 3 <= columns <= MAX_COLUMNS:
        raise ParameterError(f"columns: got {columns}, expected 3 to {MAX_COLUMNS}")
    with open_file(path, "file of float32 rows") as file:
        return _rows(path, file.array(), columns, guessed=guessed, recover=recover)


def _rows(path: Path, content: NDArray[np.uint8], columns: int, *, guessed: bool, recover: bool) -> NDArray[np.float32]:
    row_bytes = FLOAT_BYTES * columns
    whole = len(content) // row_bytes * row_bytes
    if not len(content):
        message = f"empty, expected {columns} float32 a point"
        if not recover:
            raise TruncatedFileError(f"{message}; write it again")
        warnings.warn(f"{path}: {message}", RecoveredFileWarning, stacklevel=4)
    if whole != len(content):
        message = (
            f"{len(content)} bytes is not a multiple of {row_bytes} ({columns} float32 a point); "
            f"last whole point ends at {whole}"
        )
        if not recover:
            other = "columns=" if guessed else "another columns="
            raise TruncatedFileError(
                f"{message}; pass {other} if rows are of another length; else copy it again, or have ldls.read_points "
                "recover the whole points"
            )
        warnings.warn(f"{path}: {message}", RecoveredFileWarning, stacklevel=4)
    values = np.frombuffer(content, "<f4", count=whole // FLOAT_BYTES)
    if guessed:
        _check_positions(values, columns)
        _check_rings(values, columns)
        _check_directions(values, columns)
    return values.reshape(-1, columns).astype(np.float32, copy=False)


def _check_positions(values: NDArray[np.float32], columns: int) -> None:
    """Refuse a guess by which points lie where no lidar reaches, if with other columns or numbers none does."""
    if _are_positions(values, columns):
        return
    likeliest = _likeliest(values)
    if likeliest is not None:
        raise _wrong_guess(columns, f"then points lie farther than {FARTHEST_M:.0e} m", likeliest)
    for other in OTHER_NUMBERS:
        numbers = np.frombuffer(values, other, count=values.nbytes // np.dtype(other).itemsize)
        most_tried = min(MOST_TRIED, numbers.size)
        if any(_are_positions(numbers[: numbers.size // tried * tried], tried) for tried in range(3, most_tried + 1)):
            raise FileFormatError(
                f"as float32 points lie farther than {FARTHEST_M:.0e} m, as {other!r} none does; write the file anew: "
                f"numpy.fromfile(path, {other!r}).astype('<f4').tofile(path)"
            )


def likeliest_columns(path: Path) -> int | None:
    """Number of columns by which the rows of a `.bin` file are points next to one another; None where there is none.

    Raises:
        FileFormatError: It is no regular file.
        FileNotFoundError: There is no such file.
    """
    with open_file(path, "cloud") as file:
        content = file.read()
    return _likeliest(np.frombuffer(content, "<f4")) if len(content) % FLOAT_BYTES == 0 else None


def _likeliest(values: NDArray[np.float32]) -> int | None:
    """The least number of columns by which steps from one point to the next are as small as by any, or nearly."""
    tried = range(3, MOST_TRIED + 1)
    fitting = [columns for columns in tried if values.size % columns == 0 and _are_positions(values, columns)]
    steps = [_step_m(values, columns) for columns in fitting]
    return next((columns for columns, step in zip(fitting, steps, strict=True) if step <= 1.25 * min(steps)), None)


def _step_m(values: NDArray[np.float32], columns: int) -> float:
    """Median distance from one point to the next in metres; those of a lidar lie along its scan lines."""
    with np.errstate(invalid="ignore"):  # NaNs that signal
        steps = np.diff(values.reshape(-1, columns)[:, :3].astype(np.float64), axis=0)
    distances = np.linalg.norm(steps, axis=1)
    return float(np.nanmedian(distances)) if np.isfinite(distances).any() else 0.0


def _are_positions(values: NDArray[np.floating], columns: int) -> bool:
    """True if the first three of so many columns are coordinates: none is huge, or all but zero."""
    positions = np.abs(values.reshape(-1, columns)[:, :3])
    with np.errstate(invalid="ignore"):
        return not ((positions > FARTHEST_M) | ((positions > 0) & (positions < SMALLEST_M))).any()


def _check_rings(values: NDArray[np.float32], columns: int) -> None:
    """Refuse a guess that the fifth column contradicts, where the file divides into rows of four and of five.

    Of five columns the last is nuScenes' ring number; all zeros are no evidence for five, nor against it.
    """
    other = 9 - columns
    if values.size == 0 or values.size % other:
        return
    fifth = values[4::5]
    with np.errstate(invalid="ignore"):  # the bits of some numbers that are none make NumPy warn
        are_rings = bool(((fifth == np.floor(fifth)) & (fifth >= 0) & (fifth < MAX_RINGS)).all())
    if columns == 5 and not are_rings:
        fault = f"the fifth column does not hold ring numbers, and rows of {other} fit the file too"
    elif columns == 4 and are_rings and fifth.any():
        fault = f"with {other} the last column holds ring numbers"
    else:
        return
    raise _wrong_guess(columns, fault, other)


def _check_directions(values: NDArray[np.float32], columns: int) -> None:
    """Refuse a guess by which the lidar looks elsewhere with each point, if with another number it turns by little."""
    turn_deg = _turn_deg(values, columns)
    if not turn_deg > FAR_DEG:
        return
    tried = (other for other in range(3, MOST_TRIED + 1) if values.size % other == 0)
    others = (other for other in tried if other % columns or not _are_alike(values, columns, other // columns))
    likeliest = next((other for other in others if _turn_deg(values, other) < NEAR_DEG), None)
    if likeliest is not None:
        fault = f"then each point lies {turn_deg:.0f} degrees to the side of the last, with {likeliest} beside it"
        raise _wrong_guess(columns, fault, likeliest)


def _turn_deg(values: NDArray[np.float32], columns: int) -> float:
    """Median angle from one point to the next, seen from above, of a sample; NaN where hardly any has a direction."""
    rows = values.reshape(-1, columns)
    if len(rows) <= FEWEST_SAMPLED:
        return np.nan
    at = np.linspace(0, len(rows) - 2, min(SAMPLED_POINTS, len(rows) - 1)).astype(np.intp)
    with np.errstate(invalid="ignore"):  # NaNs that signal
        one, other = (rows[places, :2].astype(np.float64) @ (1, 1j) for places in (at, at + 1))
        turned = np.conj(one) * other
        turns = np.angle(turned[np.abs(turned) > 0], deg=True)
    return float(np.median(np.abs(turns))) if len(turns) >= FEWEST_SAMPLED else np.nan


def _are_alike(values: NDArray[np.float32], columns: int, period: int) -> bool:
    """True if the rows after every `period`-th are as far away as these, as where two lidars take turns."""
    # squares of what other bytes than floats make go beyond single precision
    rows = np.nan_to_num(values.reshape(-1, columns)[:, :2]).astype(np.float64)
    one, other = (float(np.median(np.hypot(*rows[start::period].T))) for start in (0, 1))
    return one < 4 * other and other < 4 * one


def _wrong_guess(columns: int, fault: str, likeliest: int) -> FileFormatError:
    return FileFormatError(
        f"guessed {columns} floats a point, but {fault}; pass columns={likeliest} (or columns={columns} to insist)"
    )
