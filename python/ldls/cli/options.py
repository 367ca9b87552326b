"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from ldls.errors import ParameterError


class SuitePart(StrEnum):
    """Parts of the simulated suite."""

    VALIDATION = "validation"
    TUNING = "tuning"


FRAMES_FAILED = 2
"""Exit status where frames failed and the rest is done."""
STOPPED = 130
"""Exit status after Ctrl-C, as of other programs."""


def words(text: str) -> tuple[str, ...]:
    """The words of a list separated by commas, without the blanks around them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def refuse(options: Mapping[str, object], why: str) -> None:
    """Refuse options, by their names, that were given and have no place here.

    Raises:
        ParameterError: One was.
    """
    for name, value in options.items():
        if value:
            raise ParameterError(f"--{name}: {why}; leave it out")
