"""A rigid transform as it is given: an array, or a text file of its numbers."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.errors import CalibrationError
from ldls.io.files import read_lines


def read_transform(given: ArrayLike | str | PathLike[str]) -> NDArray[np.float64]:
    """(4, 4) from an array (4, 4) or a text file of 12 or 16 numbers, by rows; # begins a comment.

    Raises:
        CalibrationError: There are other than 12 or 16 numbers.
        FileNotFoundError: There is no such file.
    """
    if not isinstance(given, str | PathLike):
        return np.asarray(given, np.float64)
    path = Path(given)
    words = [word for line in read_lines(path) for word in line.partition("#")[0].replace(",", " ").split()]
    try:
        numbers = np.array(words, np.float64)
    except ValueError:
        raise CalibrationError(f"{path}: expected numbers only, got {words[:5]}") from None
    if numbers.size not in (12, 16):
        raise CalibrationError(f"{path}: expected the 12 or 16 numbers of a transform, got {numbers.size}")
    transform = np.eye(4)
    transform.flat[: numbers.size] = numbers
    return transform
