"""Which frames of a source a run takes, and under which names it writes them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PureWindowsPath

from ldls.errors import ParameterError, UnsafePathError

WINDOWS_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}


def parse_frames(text: str | None) -> slice:
    """The frames that `text` names: START:STOP:STEP, each optional, or one number; all without it.

    Raises:
        ParameterError: The text is nothing of the kind.
    """
    if text is None:
        return slice(None)
    if re.fullmatch(r"\d+", text):
        return slice(int(text), int(text) + 1)
    if not re.fullmatch(r"\d*:\d*(:[1-9]\d*)?", text):
        raise ParameterError(f"frames: got {text!r}, expected START:STOP:STEP such as 100:500:5, from 0")
    return slice(*(int(part) if part else None for part in text.split(":")))


def check_names(names: Sequence[str]) -> None:
    """Refuse frames that would be written outside the folder or over one another.

    Raises:
        UnsafePathError: A name is no plain file name, or two are the same on some file systems.
    """
    seen: dict[str, str] = {}
    for name in names:
        if not _is_plain(name):
            raise UnsafePathError(
                f"frame {name!r}: expected a plain file name without separators, '..', drive or control characters"
            )
        other = seen.setdefault(name.casefold(), name)
        if other is not name:
            raise UnsafePathError(f"frames {other!r} and {name!r}: would be written to one file; rename one of them")


def _is_plain(name: str) -> bool:
    return (
        0 < len(name) <= 200
        and name.isprintable()
        and not name.startswith(".")
        and not set(name) & set('/\\:*?"<>|')
        and PureWindowsPath(name).name == name
        and name.partition(".")[0].lower() not in WINDOWS_DEVICES
    )
