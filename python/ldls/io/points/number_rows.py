"""Rows of numbers in text, read at once; the wrong cell is looked for only where there is one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, TruncatedFileError

Row = tuple[int, str]
"""Number of a line in its file, from 1, and the line."""


def read_rows(
    path: Path,
    rows: Sequence[Row],
    positions: Sequence[int],
    delimiter: str | None = None,
) -> NDArray[np.float64]:
    """(N, len(positions)) float64: the cells at `positions`, from 0, of every row.

    Args:
        path: The file, for messages.
        rows: Lines that hold cells.
        positions: Columns wanted.
        delimiter: What stands between cells; None for any blanks.

    Raises:
        TruncatedFileError: The last row has too few cells.
        CorruptFileError: Another row has too few cells, or a cell is no number; the message names the line.
    """
    if not rows:
        return np.zeros((0, len(positions)))
    lines = [line for _, line in rows]
    try:
        return np.loadtxt(
            lines, np.float64, comments=None, delimiter=delimiter, usecols=list(positions), ndmin=2, quotechar='"'
        )
    except ValueError as error:
        _refuse_wrong_cell(path, rows, positions, delimiter)
        raise CorruptFileError(f"{path}: not rows of numbers ({error})") from None


def _refuse_wrong_cell(path: Path, rows: Sequence[Row], positions: Sequence[int], delimiter: str | None) -> None:
    wanted = max(positions) + 1
    for number, line in rows:
        cells = line.split(delimiter)
        place = f"{path}, line {number}"
        if len(cells) < wanted:
            error = TruncatedFileError if number == rows[-1][0] else CorruptFileError
            raise error(f"{place}: expected at least {wanted} cells, got {len(cells)}: {line[:80]!r}")
        for position in positions:
            _check_number(place, position, cells[position])


def _check_number(place: str, position: int, cell: str) -> None:
    try:
        float(cell.strip().strip('"'))
    except ValueError:
        raise CorruptFileError(
            f"{place}: expected a number with a decimal point in column {position + 1}, got {cell.strip()[:40]!r}"
        ) from None
