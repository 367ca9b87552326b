"""Headers of lines, and rows of numbers, in text; the wrong cell is looked for only where there is one."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from ldls.checks.values import number_of
from ldls.errors import CorruptFileError, TruncatedFileError

Row = tuple[int, str]
"""Number of a line in its file, from 1, and the line; with its end, which the last one may lack."""
MAX_HEADER_BYTES = 1 << 16
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
COMMENTS = ("#", "//")
DIGIT = re.compile("[0-9]")
QUOTE_BEHIND_BLANKS = re.compile('(^|[;,\t]) +"')
MOST_LOST_M = 5e-4
"""What coordinates in text may lose in single precision; UTM's lose more, and are kept in doubles."""


def split_header(content: bytes, last: str) -> tuple[list[Row], bytes]:
    """The numbered lines of the header up to the one that begins with the word `last`, and the bytes after it.

    Raises:
        TruncatedFileError: The file is empty.
        CorruptFileError: No line begins with `last`.
    """
    if not content:
        raise TruncatedFileError("empty, expected a header")
    start = len(BYTE_ORDER_MARK) if content.startswith(BYTE_ORDER_MARK) else 0
    lines: list[Row] = []
    while start < min(len(content), MAX_HEADER_BYTES):
        end = content.find(b"\n", start, MAX_HEADER_BYTES)
        end = len(content) if end < 0 else end
        line = content[start : min(end, MAX_HEADER_BYTES)].decode("utf-8", "replace").strip()
        lines.append((len(lines) + 1, line))
        start = end + 1
        if line.split()[:1] == [last]:
            return lines, content[start:]
    raise CorruptFileError(f"no line {last!r} in the first {MAX_HEADER_BYTES} bytes; is its header whole?")


def as_text(body: bytes) -> str:
    """What stands behind a header.

    Raises:
        CorruptFileError: It is not text.
    """
    try:
        return body.decode("utf-8")
    except UnicodeDecodeError as error:
        raise CorruptFileError(f"not text ({error.reason} at byte {error.start} after the header)") from None


def text_rows(text: str, n_header_lines: int = 0) -> list[Row]:
    """The numbered lines of `text`, which stands behind a header, that are not blank."""
    lines = enumerate(text.splitlines(keepends=True), start=n_header_lines + 1)
    return [(number, line) for number, line in lines if line.strip()]


def whole_number(place: str, word: str) -> int:
    """`word` as a number from 0.

    Raises:
        CorruptFileError: It is none.
    """
    # longer numbers count nothing that a file holds
    if not (word.isascii() and word.isdigit() and len(word) <= 18):
        raise CorruptFileError(f"{place}: expected a whole number from 0, got {word[:40]!r}")
    return int(word)


def read_rows(
    rows: Sequence[Row], positions: Sequence[int], n_cells: int, delimiter: str | None = None
) -> NDArray[np.float64]:
    """(N, len(positions)) float64: the cells at `positions`, from 0, of every row.

    Args:
        rows: Lines that hold cells. What follows the last cell that is wanted of the last line, be it a blank or the
            line's end, says that it is whole: 12.3 at the very end of a file may be what is left of 12.345.
        positions: Columns wanted.
        n_cells: Most cells that a row may have; what follows them must be no number.
        delimiter: What stands between cells; None for any blanks.

    Raises:
        TruncatedFileError: The last row has too few cells, or nothing follows its last one.
        CorruptFileError: Another row has too few cells, one has more numbers, or a cell is no number; the message names
            the line.
    """
    if not rows:
        return np.zeros((0, len(positions)))
    lines = [line for _, line in rows]
    numbers = None
    if delimiter is None and list(positions) == list(range(n_cells)):
        # where all cells between blanks are wanted, NumPy counts them as it goes
        with suppress(ValueError):
            numbers = _loaded(lines, None, None)
    if numbers is None or numbers.shape[1] != n_cells:
        try:
            numbers = _loaded(lines, delimiter, positions)
        except ValueError as error:
            _refuse_long_row(rows, n_cells, delimiter)
            _refuse_wrong_cell(rows, positions, delimiter)
            raise CorruptFileError(f"not rows of numbers ({error})") from None
        _refuse_long_row(rows, n_cells, delimiter)
    number, last = rows[-1]
    cells = last.split(delimiter)
    if not last[-1].isspace() and max(positions) == len(cells) - 1:
        raise TruncatedFileError(
            f"line {number}: the file ends with {cells[-1][:40]!r}, of which digits may be missing; add a line end if "
            "the file is whole"
        )
    return numbers


def of_kinds(
    names: Sequence[str], cells: NDArray[np.float64], kinds: Sequence[np.dtype[np.number]]
) -> list[NDArray[np.number]]:
    """The columns of text, x y z first, in the types that the header gives them.

    Coordinates of which these lose digits stay in doubles.

    Raises:
        CorruptFileError: A type is one of whole numbers, and a number is none or too large for it.
    """
    columns = [_of_kind(*each) for each in zip(names, cells.T, kinds, strict=True)]
    if any(_lost_m(cells[:, axis], columns[axis]) > MOST_LOST_M for axis in range(3)):
        columns[:3] = cells.T[:3]
    return columns


def _lost_m(written: NDArray[np.float64], kept: NDArray[np.number]) -> float:
    """The most that a coordinate (n,) in metres loses in the type that the header gives it."""
    finite = np.isfinite(written) & np.isfinite(kept)
    return float(np.abs(written[finite] - kept[finite]).max(initial=0))


def _of_kind(name: str, column: NDArray[np.float64], kind: np.dtype[np.number]) -> NDArray[np.number]:
    if kind.kind == "f":
        with np.errstate(over="ignore"):  # too large a number is an infinite one, as for any reader
            return column.astype(kind)
    limits = np.iinfo(kind.str)
    fits = (column >= limits.min) & (column <= limits.max) & (column == np.trunc(column))
    if not fits.all():
        at = int(np.argmin(fits))
        raise CorruptFileError(
            f"{name} of point {at} is {column[at]}, expected whole numbers {limits.min} to {limits.max}"
        )
    return column.astype(kind)


def _loaded(lines: Sequence[str], delimiter: str | None, positions: Sequence[int] | None) -> NDArray[np.float64]:
    if delimiter is not None:
        # NumPy takes a quote behind a blank for text
        lines = [QUOTE_BEHIND_BLANKS.sub(r'\1"', line) if '"' in line else line for line in lines]
    return np.loadtxt(lines, np.float64, comments=None, delimiter=delimiter, usecols=positions, ndmin=2, quotechar='"')


def _refuse_long_row(rows: Sequence[Row], n_cells: int, delimiter: str | None) -> None:
    """Refuse a row with a number behind its last cell, as decimal commas make them; text there harms nothing."""
    for number, line in rows:
        # counting what stands between cells is cheaper than parting them, and a look for digits than parsing
        if delimiter is not None and line.count(delimiter) < n_cells:
            continue
        behind = line.split(delimiter, n_cells)[n_cells:]
        if not behind or not DIGIT.search(behind[0]):
            continue
        surplus = [*takewhile(lambda cell: not cell.lstrip().startswith(COMMENTS), cells_of(line, delimiter)[n_cells:])]
        if any(map(is_number, surplus)):
            raise CorruptFileError(
                f"line {number}: expected {n_cells} cells, got {n_cells + len(surplus)}: {line.strip()[:80]!r}; "
                "numbers need a decimal point, and every row as many cells as the columns that the file says"
            )


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """The cells of a line; a delimiter in quotes is none."""
    if '"' in line:
        return next(csv.reader([line.strip(" \r\n")], delimiter=delimiter or " ", skipinitialspace=True))
    return line.split(delimiter)


def is_number(cell: str) -> bool:
    """True for a cell, in quotes or not, that holds a number."""
    try:
        number_of(cell.strip().strip('"'))
    except ValueError:
        return False
    return True


def _refuse_wrong_cell(rows: Sequence[Row], positions: Sequence[int], delimiter: str | None) -> None:
    wanted = max(positions) + 1
    for number, line in rows:
        cells = cells_of(line, delimiter)
        if len(cells) < wanted:
            error = TruncatedFileError if number == rows[-1][0] else CorruptFileError
            raise error(f"line {number}: expected at least {wanted} cells, got {len(cells)}: {line.strip()[:80]!r}")
        for position in positions:
            if not is_number(cells[position]):
                raise CorruptFileError(
                    f"line {number}: expected a number with a decimal point in column {position + 1}, "
                    f"got {cells[position].strip()[:40]!r}"
                )
