"""Headers of lines, and rows of numbers, in text; the wrong cell is looked for only where there is one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, TruncatedFileError

Row = tuple[int, str]
"""Number of a line in its file, from 1, and the line."""
MAX_HEADER_BYTES = 1 << 16
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def split_header(path: Path, content: bytes, last: str) -> tuple[list[Row], bytes]:
    """The numbered lines of the header up to the one that begins with the word `last`, and the bytes after it.

    Raises:
        TruncatedFileError: The file is empty.
        CorruptFileError: No line begins with `last`.
    """
    if not content:
        raise TruncatedFileError(f"{path}: empty, expected a header")
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
    raise CorruptFileError(f"{path}: no line {last!r} in the first {MAX_HEADER_BYTES} bytes; is its header whole?")


def text_rows(path: Path, body: bytes, n_header_lines: int) -> list[Row]:
    """The numbered lines of `body` that are not blank.

    Raises:
        CorruptFileError: It is not text.
    """
    try:
        lines = body.decode("utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise CorruptFileError(f"{path}: not text ({error.reason} at byte {error.start} after the header)") from None
    return [(number, line) for number, line in enumerate(lines, start=n_header_lines + 1) if line.strip()]


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
