"""Point arrays from users, checked once, and what arrays of numbers are called."""

from __future__ import annotations

from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.checks import as_array
from ldls.errors import DtypeError, InputError, ShapeError

MAX_COLUMNS = 64
"""Wider arrays are clouds lying on their side."""

WIDEST_CLOUD_M = 10_000.0
"""Extent beyond which the unit is probably not the metre."""

Points = NDArray[np.float32] | NDArray[np.float64]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def is_finite(points: Points) -> NDArray[np.bool_]:
    """(N,) True for the points (N, >= 3) whose coordinates are all finite."""
    return np.asarray(np.isfinite(points[:, :3]).all(axis=1))


def finite_rows(points: Points) -> NDArray[np.int64]:
    """Rows of the points (N, >= 3) whose coordinates are all finite, ascending."""
    return np.flatnonzero(is_finite(points))


def doubt_of_scale(low: ArrayLike, high: ArrayLike) -> str | None:
    """What is odd about the extent of points from `low` to `high` (3,), in metres; None where nothing is."""
    extent = float(np.max(np.subtract(high, low)))
    if not extent > WIDEST_CLOUD_M:
        return None
    return f"points: extent is {extent:.3g} m, over 10 km; are they in metres? Divide millimetres by 1000"


def as_points(points: ArrayLike) -> Points:
    """`points` as a C-contiguous (N, >= 3) array of float32 or float64, copied only where it must be.

    Raises:
        InputError: It is the name of a file.
        DtypeError: The values are not float32 or float64, or are masked.
        ShapeError: The array is not (N, >= 3).
        LimitError: More rows than labels can be numbered for; before any copy.
    """
    if isinstance(points, str | PathLike):
        raise InputError(f"points: got the text {str(points)[:80]!r}, expected an array; ldls.read_points reads files")
    array = as_array("points", points)
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        fix = "a plain array of rows" if array.dtype.kind in "OV" else "points.astype(numpy.float32)"
        raise DtypeError(f"points: expected float32 or float64, got {array.dtype}; pass {fix}")
    if array.ndim != 2 or not 3 <= array.shape[1] <= MAX_COLUMNS:
        transposed = array.ndim == 2 and 3 <= array.shape[0] <= MAX_COLUMNS
        fix = "; transpose?" if transposed else ""
        raise ShapeError(f"points: expected shape (N, 3) or wider, got {array.shape}{fix}")
    return np.require(array, array.dtype.newbyteorder("="), ["C", "A"])
