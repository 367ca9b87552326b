"""Lines of KITTI's calibration files: a key, then the numbers of a matrix."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CalibrationError

Matrices = dict[str, NDArray[np.float64]]


def read_matrices(path: Path, sizes: Mapping[str, int], spellings: Mapping[str, str]) -> Matrices:
    """The numbers of each line whose key is in `sizes`, which says how many there are, by that key.

    Args:
        path: The file.
        sizes: How many numbers each line holds that is wanted.
        spellings: Other keys for some of them.

    Raises:
        CalibrationError: A key is doubled, or a line does not hold the numbers it should.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: not a text file ({error.reason} at {error.start})") from None
    matrices: Matrices = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        key = spellings.get(words[0].rstrip(":"), words[0].rstrip(":")) if words else ""
        if key not in sizes:
            continue
        if key in matrices:
            raise CalibrationError(f"{path}, line {number}: key '{words[0]}' stands there twice")
        matrices[key] = _numbers(f"{path}, line {number}", words[1:], sizes[key])
    return matrices


def get_matrix(path: Path, matrices: Matrices, key: str, archive: str) -> NDArray[np.float64]:
    """The numbers under `key`.

    Raises:
        CalibrationError: There are none; the message asks whether `archive` was unpacked.
    """
    if key not in matrices:
        found = " ".join(matrices) or "none"
        raise CalibrationError(f"{path}: key '{key}' missing; found {found}; did you unpack {archive}?")
    return matrices[key]


def homogeneous(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4, 4) from a (3, 3) rotation or a (3, 4) transform."""
    full = np.eye(4)
    full[:3, : matrix.shape[1]] = matrix
    return full


def _numbers(place: str, words: list[str], expected: int) -> NDArray[np.float64]:
    if len(words) != expected:
        raise CalibrationError(f"{place}: expected {expected} numbers, got {len(words)}")
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        raise CalibrationError(f"{place}: expected numbers with a decimal point, got {words}") from None
    if not np.isfinite(numbers).all():
        raise CalibrationError(f"{place}: expected finite numbers, got {words}")
    return numbers
