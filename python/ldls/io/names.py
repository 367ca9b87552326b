"""The names of files and frames: their order, and which are hidden."""

from __future__ import annotations

import re

NUMBER = re.compile(r"(?<![0-9])(?<![0-9]\.)0*([0-9]+)")
"""A whole number in a name, without what follows its decimal point."""


def name_order(name: str) -> tuple[str, str]:
    """Key by which names of files and frames are sorted: as text, but numbers by their value, so that 2 is before 10.

    Names with leading zeros keep the order of text, and so do decimals, as those of seconds: 1.25 is before 1.5.
    """
    return NUMBER.sub(lambda number: f"{len(number[1]):03}{number[1]}", name), name


def is_hidden(name: str) -> bool:
    """True if a file is one that people do not see, as file managers leave them: .DS_Store, ._0.png, Thumbs.db."""
    return name.startswith(".") or name in ("Thumbs.db", "desktop.ini")
