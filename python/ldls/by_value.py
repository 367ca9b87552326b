"""Equality of nouns that hold arrays."""

from __future__ import annotations

from dataclasses import fields

import numpy as np


class ByValue:
    """Base of dataclasses with arrays: two of one class are equal where their fields are, NaN in arrays to NaN."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(map(same, self._values(), other._values()))

    def __hash__(self) -> int:
        # arrays have none
        return hash((type(self), *(value for value in self._values() if not isinstance(value, np.ndarray))))

    def _values(self) -> list[object]:
        return [getattr(self, field.name) for field in fields(self) if field.compare]  # type: ignore[arg-type]


def same(one: object, other: object) -> bool:
    """True if two values are equal, arrays in shape and in every element."""
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == other.dtype.kind == "f")
    return not isinstance(one, np.ndarray) and not isinstance(other, np.ndarray) and bool(one == other)
