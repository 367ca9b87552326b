"""Headers in text before points in binary."""

from __future__ import annotations

from pathlib import Path

from ldls.errors import CorruptFileError, TruncatedFileError
from ldls.io.points.number_rows import Row

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
