"""Words of which some are known, or an error that names the nearest."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from typing import TypeVar

from ldls.errors import ParameterError

_Word = TypeVar("_Word", bound=str)


def choice(name: str, value: _Word, known: Collection[str]) -> _Word:
    """`value`, if it is one of those `known`.

    Raises:
        ParameterError: It is none; the message lists them and has the nearest.
    """
    if value not in known:
        expected = f"expected one of {', '.join(known)}{did_you_mean(str(value), known)}"
        raise ParameterError(f"{name}: got {value!r}, {expected}")
    return value


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The end of a message: "; did you mean 'label'?", of those `known` the nearest; empty where none is near."""
    spelt = {each.lower(): each for each in known}
    near = get_close_matches(word.lower(), spelt, n=1, cutoff=0.5)
    return f"; did you mean {spelt[near[0]]!r}?" if near else ""
