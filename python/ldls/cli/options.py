"""What several commands take in the same way."""

from __future__ import annotations

from enum import StrEnum


class SuitePart(StrEnum):
    """Parts of the simulated suite."""

    VALIDATION = "validation"
    TUNING = "tuning"


def words(text: str) -> tuple[str, ...]:
    """The words of a list separated by commas, without the blanks around them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())
