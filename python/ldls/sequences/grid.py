"""Cells of a grid, each with one number by which it can be sorted and found."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.errors import LimitError

BITS = 21
"""Bits of a cell's place along an axis: three of them and a sign are a number of 64 bits."""
FARTHEST = 2**20 - 1
"""Most cells between a cell and that of the origin, along an axis."""


def cell_keys(coordinates: NDArray[np.float64], cell_m: float) -> NDArray[np.int64]:
    """(n,) a number for the cell of each point: the same in the same cell, another in every other.

    Args:
        coordinates: (n, d) finite, in metres, with d of 1 to 3.
        cell_m: Side of a cell.

    Raises:
        LimitError: A point is farther from the origin than can be numbered.
    """
    with np.errstate(over="ignore"):
        cells = np.floor(coordinates / cell_m)
    farthest = float(np.abs(cells).max(initial=0))
    if not farthest <= FARTHEST:
        raise LimitError(
            f"points: one is {farthest * cell_m:.6g} m from where the grid begins, expected at most "
            f"{FARTHEST * cell_m:.6g} m with cells of {cell_m:g} m; take larger ones, or leave such points out"
        )
    keys = np.zeros(len(coordinates), np.int64)
    for axis in cells.T:
        keys = (keys << BITS) + axis.astype(np.int64) + (FARTHEST + 1)
    return keys
