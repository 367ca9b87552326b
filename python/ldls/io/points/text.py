"""Rows of text: `.csv`, `.txt` and `.xyz`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import MAX_COLUMNS
from ldls.errors import CorruptFileError, TruncatedFileError, UnsupportedFormatError
from ldls.io.files import read_lines
from ldls.io.points.named_columns import NamedColumns, plain_name
from ldls.io.points.text_rows import Row, read_rows

COMMENTS = ("#", "//")
DELIMITERS = (";", "\t", ",")
"""Tried in this order; where none stands in the first line, blanks separate."""


def read(path: Path) -> NDArray[np.float64]:
    """(N, >= 3) float64 points of a text file, in its own units.

    A first line with the names x, y and z, behind a comment sign or not, says which columns are meant; without one all
    columns are taken as they stand, x y z first. Other lines that begin with # or // are comments.

    Raises:
        TruncatedFileError: The file is empty, or its last line has too few cells.
        CorruptFileError: Another line has too few cells, or a cell is no number; the message names it.
        UnsupportedFormatError: There are more columns than clouds have.
    """
    lines = read_lines(path)
    rows = [(number, line) for number, line in enumerate(lines, start=1) if line.strip()]
    if not rows:
        raise TruncatedFileError(f"{path}: empty, expected a line x y z for each point")
    names = _names(rows[0][1])
    if names is not None:
        rows = rows[1:]
    rows = [row for row in rows if not row[1].lstrip().startswith(COMMENTS)]
    if names is not None:
        delimiter = _delimiter(rows[0][1]) if rows else None
        return read_rows(path, rows, NamedColumns.find(f"{path}, line 1", names).positions, delimiter)
    return _read_nameless(path, rows)


def _names(line: str) -> list[str] | None:
    bare = line.lstrip("#/ ")
    names = [name.strip() for name in bare.split(_delimiter(bare))]
    return names if {"x", "y", "z"} <= {plain_name(name) for name in names} else None


def _read_nameless(path: Path, rows: list[Row]) -> NDArray[np.float64]:
    if not rows:
        raise TruncatedFileError(f"{path}: only comments, expected a line x y z for each point")
    number, first = rows[0]
    delimiter = _delimiter(first)
    n_columns = len(first.split(delimiter))
    if n_columns < 3:
        raise CorruptFileError(f"{path}, line {number}: expected x y z or their names, got {first[:80]!r}")
    if n_columns > MAX_COLUMNS:
        raise UnsupportedFormatError(f"{path}, line {number}: {n_columns} columns, expected at most {MAX_COLUMNS}")
    return read_rows(path, rows, range(n_columns), delimiter)


def _delimiter(line: str) -> str | None:
    return next((sign for sign in DELIMITERS if sign in line.strip()), None)
