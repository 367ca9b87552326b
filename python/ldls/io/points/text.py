"""Rows of text: `.csv`, `.txt`, `.xyz`, `.asc` and `.pts`."""

from __future__ import annotations

import re
from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import MAX_COLUMNS
from ldls.errors import CorruptFileError, TruncatedFileError, UnsupportedFormatError
from ldls.io.files import open_file
from ldls.io.points.named_columns import find_columns, plain_name
from ldls.io.points.text_rows import COMMENTS, Row, cells_of, is_number, read_rows, text_rows

DELIMITERS = (";", "\t", ",")
"""Tried in this order; where none stands in the first line, blanks separate."""
QUOTED = re.compile('"[^"]*"')
HEADING = re.compile(r'[^"]*:\s+')
"""What may stand before names: Columns: x y z."""


def read(path: Path) -> NDArray[np.float64]:
    """(N, >= 3) float64 points of a text file, in its own units.

    A line with the names x, y and z before the numbers, behind a comment sign or not, says which columns are meant;
    without one all columns are taken as they stand, x y z first, up to three that are colours (whole numbers to 255) or
    normals. Other lines that begin with # or // are comments. A number alone above the points, as in `.pts`, is their
    count.

    Raises:
        TruncatedFileError: The file is empty, its last line has too few cells, there are fewer points than it counts,
            or it ends with its last number, without a line end: that number may be cut short.
        CorruptFileError: There are more points than it counts, another line has too few cells, one has a number behind
            as many cells as the first, or a cell is no number; the message names it. Or the first line has names, of
            which none are x, y and z.
        UnsupportedFormatError: There are more columns than clouds have.
    """
    with open_file(path, "text file of points") as file:
        return _parse(file.text())


def _parse(text: str) -> NDArray[np.float64]:
    rows = text_rows(text)
    if not rows:
        raise TruncatedFileError("empty, expected a line x y z for each point")
    body = _behind_count([row for row in rows if not _is_comment(row)])
    n_cells = max((len(cells_of(line, _delimiter(line))) for _, line in body[:1]), default=MAX_COLUMNS)
    # comments may stand above the names, which may be one themselves
    comments = [row for row in takewhile(_is_comment, rows) if _has_columns(row[1], n_cells, is_first=row is rows[0])]
    told = ((number, _names(line)) for number, line in [*body[:1], *comments])
    number, names = next((each for each in told if each[1] is not None), (0, None))
    rows = _behind_count([row for row in body if row[0] > number])
    if names is None:
        return _parse_nameless(rows)
    delimiter = _delimiter(rows[0][1]) if rows else None
    return read_rows(rows, find_columns(f"line {number}", names), len(names), delimiter)


def _behind_count(rows: list[Row]) -> list[Row]:
    """Rows of points, held against their count where a line of it stands above them."""
    count = rows[0][1].strip() if len(rows) > 1 else ""
    # longer numbers count nothing that a file holds
    if not (count.isascii() and count.isdigit() and len(count) <= 18):
        return rows
    found = len(rows) - 1
    if found != int(count):
        error = TruncatedFileError if found < int(count) else CorruptFileError
        raise error(f"line {rows[0][0]}: the file counts {count} points, got {found}")
    return rows[1:]


def _is_comment(row: Row) -> bool:
    return row[1].lstrip().startswith(COMMENTS)


def _names(line: str) -> list[str] | None:
    heading = HEADING.match(line)
    bare = line.lstrip("#/ ") if heading is None else line[heading.end() :]
    names = [name.strip() for name in cells_of(bare, _delimiter(bare))]
    return names if {"x", "y", "z"} <= {plain_name(name) for name in names} or _are_words(line, names) else None


def _has_columns(comment: str, n_cells: int, *, is_first: bool) -> bool:
    """True for names of so many columns; or with x y z side by side, unlike a sentence: x ahead, y to the left.

    Below the first line, or behind a colon, names of other columns than there are make a sentence as well.
    """
    names = _names(comment)
    if names is None or len(names) == n_cells:
        return names is not None
    at = sorted(number for number, name in enumerate(names) if plain_name(name) in {"x", "y", "z"})
    is_near = at[-1] - at[0] == len(at) - 1 and (is_first or at[-1] < n_cells)
    return is_near and not HEADING.match(comment)


def _are_words(line: str, cells: list[str]) -> bool:
    """True for a line of words, no comment, without a number."""
    return line.strip().lstrip("\"'")[:1].isalpha() and not any(map(is_number, cells))


def _parse_nameless(rows: list[Row]) -> NDArray[np.float64]:
    if not rows:
        raise TruncatedFileError("only comments, expected a line x y z for each point")
    number, first = rows[0]
    delimiter = _delimiter(first)
    # some writers put one behind each number
    n_columns = len(first.strip().rstrip(delimiter).split(delimiter))
    if n_columns < 3:
        raise CorruptFileError(f"line {number}: expected x y z or their names, got {first.strip()[:80]!r}")
    if n_columns > MAX_COLUMNS:
        raise UnsupportedFormatError(f"line {number}: {n_columns} columns, expected at most {MAX_COLUMNS}")
    return _without_colours(read_rows(rows, range(n_columns), n_columns, delimiter))


def _without_colours(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns up to colours or normals, which are no intensity: three side by side behind x y z, or behind a fourth."""
    # behind x y z first, for red before green, blue and an intensity of whole numbers would be one
    for start in (3, 4):
        beside = columns[:, start : start + 3]
        if beside.shape[1] == 3 and len(beside) and (_are_colours(beside) or _are_normals(beside)):
            return columns[:, :start]
    return columns


def _are_colours(values: NDArray[np.float64]) -> bool:
    """True for whole numbers from 0 to 255, in each column some larger than numbers of classes or returns."""
    are_bytes = (values >= 0) & (values <= 255) & (values == np.floor(values))
    return bool(are_bytes.all() and (values > 32).any(axis=0).all())


def _are_normals(values: NDArray[np.float64]) -> bool:
    """True for vectors of length 1."""
    return bool((np.abs(np.linalg.norm(values, axis=1) - 1) < 0.01).all())


def _delimiter(line: str) -> str | None:
    bare = QUOTED.sub('""', line).strip()
    return next((sign for sign in DELIMITERS if sign in bare), None)
