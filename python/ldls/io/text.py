"""Text files, line by line."""

from __future__ import annotations

from pathlib import Path

from ldls.errors import CorruptFileError
from ldls.io.regular_file import regular_file


def read_lines(path: Path) -> list[str]:
    """The lines of a text file without their ends; the blank ones at its end are left out.

    Raises:
        CorruptFileError: It is not text.
        FileFormatError: It is a folder, a pipe or a device.
    """
    try:
        text = regular_file(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise CorruptFileError(f"{path}: not a text file ({error.reason} at byte {error.start})") from None
    return text.rstrip().splitlines()
