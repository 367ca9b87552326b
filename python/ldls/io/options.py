"""Options of the reader or writer of one format, held against those that it has."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from difflib import get_close_matches

from ldls.errors import ParameterError


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
            near = get_close_matches(option, known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise ParameterError(f"{option}: no option of {place}; {expected}{hint}")
    return known
