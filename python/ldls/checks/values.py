"""Words that are known, numbers, sizes and arrays of a type and shape, or an error that names the argument."""

from __future__ import annotations

import operator
import sys
from collections.abc import Callable, Collection, Iterable
from difflib import get_close_matches
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from ldls.errors import DtypeError, InputError, LdlsError, LimitError, ParameterError, ShapeError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_Word = TypeVar("_Word", bound=str)
MAX_ROWS = 2**31 - 1
"""Most rows of an array: points and labels are numbered by 32 bits with sign."""
LATEST_S = 9.2e9
"""Stamps are below it: in 2261, nanoseconds since 1970 run out of 64 bits. Milliseconds passed it in April 1970."""
PYTHONS: dict[type, Callable[[Any], object]] = {Integral: int, Real: float, str: str.__str__}
"""What makes Python's own of a kind of number, and of text."""
LONGEST = 80
"""Characters of a value that a message shows."""


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


def whole_number(name: str, value: object, low: int, high: int = MAX_ROWS) -> int:
    """`value` as an int.

    Raises:
        ParameterError: It is no whole number from `low` to `high`.
    """
    if not is_whole(value) or not low <= operator.index(value) <= high:  # type: ignore[arg-type]
        raise ParameterError(f"{name}: got {shown(value)}, expected a whole number from {low} to {high}")
    return operator.index(value)  # type: ignore[arg-type]


def number_of(word: str) -> float:
    """The number that stands in a file as `word`.

    Raises:
        ValueError: It is none.
    """
    # which Python takes, too: 7_21.5 may be what is left of two numbers
    if "_" in word or not word.isascii():
        raise ValueError(f"{word!r} is no number")
    return float(word)


def as_seconds(name: str, stamp: float, error: type[LdlsError] = ParameterError) -> float:
    """`stamp`, in seconds since 1970 or since the start of a drive.

    Raises:
        ParameterError: It is none, or of another unit; or another `error`.
    """
    if not abs(stamp) < LATEST_S:
        raise error(f"{name}: got {stamp}, expected seconds below {LATEST_S:g}; not milliseconds, not nanoseconds")
    return stamp


def as_image_size(name: str, value: object, error: type[InputError] = ParameterError) -> tuple[int, int]:
    """`value` as (height, width) in pixels.

    Raises:
        ParameterError: It is no pair of whole numbers from 1; or another `error`.
    """
    pair = tuple(value) if isinstance(value, list | tuple) else ()
    if len(pair) != 2 or not all(is_whole(side) and 0 < operator.index(side) <= MAX_ROWS for side in pair):
        raise error(f"{name} is {shown(value)}, expected (height, width) in whole pixels")
    return operator.index(pair[0]), operator.index(pair[1])


def as_array(name: str, values: object, error: type[InputError] | None = None) -> NDArray[Any]:
    """`values` as an array of whatever type and shape; no copy of one that is an array already.

    Raises:
        ShapeError: Rows of different lengths; `error` if given, as in all that follows.
        DtypeError: A masked array, or what cannot be made an array.
        LimitError: More rows than can be numbered.
    """
    import numpy as np

    if isinstance(values, loaded("numpy.ma", "MaskedArray")):
        raise (error or DtypeError)(f"{name}: got a masked array; pass {name}.filled(...) with a value")
    try:
        array = np.asarray(values)
    except MemoryError:
        raise
    except Exception as problem:  # of NumPy, or of whatever object calls itself an array
        kind = ShapeError if "inhomogeneous" in str(problem) else DtypeError
        raise (error or kind)(f"{name}: expected an array of numbers, got {shown(values)}; {problem}") from None
    if array.ndim and len(array) > MAX_ROWS:
        raise LimitError(f"{name}: {len(array)} rows exceed the limit of {MAX_ROWS}; split the input")
    return array


def numbers(
    name: str,
    values: object,
    dtype: type[np.generic],
    *shapes: tuple[int | str, ...],
    error: type[InputError] | None = None,
) -> NDArray[Any]:
    """`values` as a C-contiguous, aligned array of `dtype` and of one of `shapes`, copied only where it must be.

    Args:
        name: What messages call them.
        values: Anything that NumPy makes an array of.
        dtype: A float type takes whole numbers too; an integer type those that it can hold; bool nothing else.
        shapes: Lengths by axis; text stands for any length.
        error: What to raise instead of the following.

    Raises:
        ShapeError: Another shape.
        DtypeError: Text, objects, complex numbers, or real ones where whole ones are expected.
        InputError: A whole number that `dtype` cannot hold.
        LimitError: More rows than can be numbered.
    """
    import numpy as np

    array = as_array(name, values, error)
    wanted = np.dtype(dtype)
    if array.size == 0 and not isinstance(values, np.ndarray):
        array = array.astype(wanted)  # lists without a number have no type of their own
    if array.dtype.kind not in {"f": "fiu", "i": "iu", "u": "iu", "b": "b"}[wanted.kind]:
        kind = {"f": "numbers", "i": "whole numbers", "u": "whole numbers", "b": "bool"}[wanted.kind]
        is_array = hasattr(values, "dtype")
        found = array.dtype if is_array else shown(values)
        # NumPy keeps numbers that it has no type for as objects, too
        bound = ", of 64 bits at most" if array.dtype.kind == "O" else ""
        mend = f"pass {name}.astype({wanted})" if is_array else f"give {kind} alone{bound}"
        raise (error or DtypeError)(f"{name}: expected {kind}, got {found}; {mend}")
    if not any(_fits(array.shape, shape) for shape in shapes):
        expected = " or ".join(f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})" for shape in shapes)
        raise (error or ShapeError)(f"{name}: expected shape {expected}, got {array.shape}")
    if wanted.kind in "iu" and array.size:
        low, high = np.iinfo(dtype).min, np.iinfo(dtype).max  # type: ignore[type-var]
        if not (array.min() >= low and array.max() <= high):
            raise (error or InputError)(f"{name}: got {array.min()} to {array.max()}, expected {low} to {high}")
    with np.errstate(over="ignore"):
        return np.require(array, wanted, ["C", "A"])


def shown(value: object) -> str:
    """`value` as messages show it: short, whatever it is."""
    try:
        text = repr(value) if not is_of_numpy(value, "ndarray") else f"an array of shape {value.shape}"  # type: ignore[attr-defined]
    except Exception:  # a whole number of thousands of digits, or an object that cannot say what it is
        return f"a value of type {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def is_whole(value: object) -> bool:
    """True for a whole number, NumPy's too; a bool is none."""
    try:
        operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return False
    return not isinstance(value, bool) and not is_of_numpy(value, "bool_") and not is_of_numpy(value, "ndarray")


def as_python(value: Any) -> Any:  # noqa: ANN401
    """A number, bool or text as Python's own, which files of JSON take; anything else as it is."""
    if value is None or type(value) in (bool, int, float, str):
        return value
    if is_of_numpy(value, "bool_"):
        return bool(value)
    own = next((own for kind, own in PYTHONS.items() if isinstance(value, kind)), None)
    return value if own is None else own(value)


def hold_python_values(made: object) -> None:
    """Make numbers, bools and texts that a frozen dataclass holds Python's own, as `as_python` does."""
    for name, value in vars(made).items():
        object.__setattr__(made, name, as_python(value))


def is_of_numpy(value: object, name: Literal["bool_", "ndarray"]) -> bool:
    """True for a bool or an array of NumPy, which is loaded where there is one and need not be for what has none."""
    return isinstance(value, loaded("numpy", name))


def loaded(module: str, name: str) -> Any:  # noqa: ANN401
    """The class of that name in a module; none, (), where that is not loaded yet, or half of it, by another thread."""
    return getattr(sys.modules.get(module), name, ())


def _fits(found: tuple[int, ...], shape: tuple[int | str, ...]) -> bool:
    return len(found) == len(shape) and all(
        isinstance(want, str) or have == want for have, want in zip(found, shape, strict=True)
    )
