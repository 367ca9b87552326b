"""The reader or writer that the name of a file chooses, and its options, held against those that it has."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import TypeVar

from ldls.checks import did_you_mean
from ldls.errors import ParameterError, UnsupportedFormatError

_Function = TypeVar("_Function", bound=Callable[..., object])


def of_ending(path: str | PathLike[str], known: Mapping[str, _Function], verb: str, what: str) -> _Function:
    """Return the reader or writer that has the ending of `path`, the longest where several fit, as _panoptic.npz.

    Args:
        path: The file.
        known: Readers or writers by their endings.
        verb: "read" or "write", for messages.
        what: What they read or write, as "masks".

    Raises:
        UnsupportedFormatError: There is none, or the name is an ending alone.
    """
    path = Path(path)
    endings = [ending for ending in known if path.suffix and path.name.lower().endswith(ending)]
    if not endings:
        lacking = "a name" if path.name.startswith(".") else "an ending"
        found = f"{path.suffix!r} {what}" if path.suffix else f"{what} without {lacking}"
        raise UnsupportedFormatError(f"{path}: cannot {verb} {found}, expected {', '.join(known)}")
    return known[max(endings, key=len)]


def check_options(place: str, function: Callable[..., object], given: Iterable[str]) -> tuple[str, ...]:
    """Return the options of `function`, its keyword-only parameters and `T_camera_lidar`.

    Args:
        place: The format and file, for messages.
        function: A reader or writer.
        given: Names of the options given.

    Raises:
        ParameterError: One of them is none of its options.
    """
    parameters = inspect.signature(function).parameters.values()
    known = tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY or p.name == "T_camera_lidar")
    for option in given:
        if option not in known:
            expected = f"expected {', '.join(known)}" if known else "they have none"
            raise ParameterError(f"{option}: no option of {place}; {expected}{did_you_mean(option, known)}")
    return known
