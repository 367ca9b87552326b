"""Arguments of the public face, refused by name where they are of a wrong type or shape, before any work.

`checked` holds the arguments of a function or class against their annotations; arrays, whose annotations say little,
go through `as_array` and `numbers`. What the values mean is for the callee to check.
"""

from ldls.checks.annotations import checked, checked_as
from ldls.checks.values import (
    as_array,
    as_image_size,
    as_python,
    choice,
    did_you_mean,
    hold_python_values,
    numbers,
    shown,
    whole_number,
)

__all__ = [
    "as_array",
    "as_image_size",
    "as_python",
    "checked",
    "checked_as",
    "choice",
    "did_you_mean",
    "hold_python_values",
    "numbers",
    "shown",
    "whole_number",
]
