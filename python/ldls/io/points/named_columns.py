"""Coordinates and intensity among a file's named columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Points
from ldls.errors import CorruptFileError

INTENSITY_NAMES = ("intensity", "reflectance", "reflectivity", "remission", "i")
"""Names of the intensity; the first that a file has is taken."""


def find_columns(place: str, names: Sequence[str]) -> tuple[int, ...]:
    """Numbers, from 0, of x, y, z and, where there is one, intensity among the columns of these `names`.

    Names may be in capitals, and have CloudCompare's prefix `scalar_`.

    Raises:
        CorruptFileError: x, y or z is missing or stands there twice.
    """
    plain = [plain_name(name) for name in names]
    for axis in "xyz":
        if plain.count(axis) != 1:
            there = " ".join(names) or "none"
            fault = "missing" if axis not in plain else f"there {plain.count(axis)} times"
            raise CorruptFileError(f"{place}: column {axis} is {fault}; found {there}; expected one each of x y z")
    intensity = [plain.index(name) for name in INTENSITY_NAMES if name in plain][:1]
    return (*(plain.index(axis) for axis in "xyz"), *intensity)


def stacked(columns: Sequence[NDArray[np.number]]) -> Points:
    """(N, 3 or 4) points of x, y, z and intensity: float32 where that holds the coordinates exactly, else float64."""
    exact = np.result_type(np.float32, *(column.dtype for column in columns[:3]))
    # an intensity in doubles may be too large for single precision
    with np.errstate(over="ignore", invalid="ignore"):
        points: Points = np.stack([column.astype(exact) for column in columns], axis=1)
    return points


def plain_name(name: str) -> str:
    """`name` without what writers add to it."""
    return name.strip().strip("\"'").lower().removeprefix("scalar_")
