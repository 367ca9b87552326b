"""Poses in text: rows of so many numbers, and stamps that ascend."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, TruncatedFileError
from ldls.io.points.text_rows import Row, read_rows, text_rows

COMMENT = re.compile("#[^\r\n]*")


def pose_rows(text: str) -> list[Row]:
    """The numbered lines of `text` without comments that are not blank."""
    # what takes the place of a comment says that the number before it is whole
    return text_rows(COMMENT.sub(" ", text))


def read_pose_rows(text: str, names: str) -> tuple[list[int], NDArray[np.float64]]:
    """Number of each line that holds a pose, and (n, columns) its numbers, all of them finite.

    Args:
        text: What stands in the file.
        names: Names of the columns, for messages.

    Raises:
        TruncatedFileError: There is no pose, the last line is too short, or the file ends with its last number.
        CorruptFileError: Another line has too few numbers or too many, or one of them is none; the message names it.
    """
    rows, n_columns = pose_rows(text), len(names.split())
    if not rows:
        raise TruncatedFileError(f"no pose, expected lines {names}")
    numbers = read_rows(rows, range(n_columns), n_columns)
    finite = np.isfinite(numbers).all(axis=1)
    if not finite.all():
        number, line = rows[int(np.argmin(finite))]
        raise CorruptFileError(f"line {number}: expected finite numbers {names}, got {line.strip()[:80]!r}")
    return [number for number, _ in rows], numbers


def check_ascending(lines: Sequence[int], stamps: Sequence[float]) -> None:
    """Refuse stamps, in seconds, of these lines, that do not ascend.

    Raises:
        CorruptFileError: One is not later than the one before.
    """
    for at in range(1, len(stamps)):
        if not stamps[at - 1] < stamps[at]:
            raise CorruptFileError(
                f"line {lines[at]}: stamp {stamps[at]:.6f} s after {stamps[at - 1]:.6f} s in line {lines[at - 1]}, "
                "expected ascending ones; sort the poses, and leave out those that stand there twice"
            )
