"""Arguments held against the annotations of functions and classes, at each call."""

from __future__ import annotations

import functools
import inspect
import itertools
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from os import PathLike
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin

from ldls.checks.values import did_you_mean, is_of_numpy, is_whole, loaded, shown
from ldls.errors import InputError, ParameterError

MAKERS = {
    "Camera": "make one with Camera(projection=..., T_camera_lidar=...), or ldls.read_camera of a file",
    "InstanceMasks": "make them with InstanceMasks.from_array, or ldls.read_masks of a file",
    "KittiObject": "ldls.io.labels.read_kitti_objects returns them",
    "Labeling": "make one with Labeling.from_codes, or ldls.io.labels.read_labeling of a file",
    "Params": "make them with Params(...), as in Params(sigma=0.5)",
    "Trajectory": "make one with Trajectory(stamps, poses), or ldls.read_poses of a file",
    "Segmentation": "ldls.segment and ldls.read_result return them",
    "RunSettings": 'make them with RunSettings(...), as in RunSettings(masks="masks")',
    "slice": "make one with slice(start, stop), as in slice(100) for the first hundred",
}
"""Where instances of a class come from, for messages."""

Checked = TypeVar("Checked", bound=Callable[..., Any])


def checked(callee: Checked) -> Checked:
    """`callee`, a function or class, which refuses arguments that its annotations do not allow.

    A number is refused where it is a bool or text, a bool where it is a number; annotations of arrays and pairs, and
    those that cannot be resolved, allow everything.

    Raises:
        InputError: An argument is of another type; the message names it. `ParameterError` of numbers, text and flags.
        TypeError: An argument is unknown, missing or given twice; an unknown one with the nearest that there is.
    """
    return _checked(callee, None)


def checked_as(error: type[InputError]) -> Callable[[Checked], Checked]:
    """As `checked`, for callees all of whose faults are of the class `error`."""
    return functools.partial(_checked, error=error)


def _checked(callee: Checked, error: type[InputError] | None) -> Checked:
    if isinstance(callee, type):
        # the class stays what it is, and its instances can be pickled
        type.__setattr__(callee, "__init__", _checked(callee.__init__, error))  # type: ignore[misc]
        return callee
    parameters = inspect.signature(callee).parameters
    by_place = [name for name, each in parameters.items() if each.kind in _BY_PLACE]
    takes_all = any(each.kind is inspect.Parameter.VAR_KEYWORD for each in parameters.values())
    names: dict[str, Any] = callee.__globals__

    @functools.cache
    def kinds() -> dict[str, _Kind]:
        # the names in annotations are those of the module once it is whole
        return {
            name: _ANYTHING if each.kind in _COLLECTING else _kind(_resolved(each.annotation, names))
            for name, each in parameters.items()
        }

    @functools.wraps(callee)
    def call(*arguments: Any, **keywords: Any) -> Any:  # noqa: ANN401
        # what is missing, too much or given twice is left to the call itself
        for name, value in itertools.chain(zip(by_place, arguments, strict=False), keywords.items()):
            kind = kinds().get(name, _ANYTHING if takes_all else None)
            if kind is None:
                raise _unknown(name, callee, parameters)
            if not kind.accepts(value):
                raise _refused(name, value, kind, error)
        return callee(*arguments, **keywords)

    return cast(Checked, call)


class _Kind:
    """What an annotation allows.

    Attributes:
        accepts: True for a value that it allows.
        name: What messages call it.
        is_noun: True if it is an instance of a class, or a container of such.
    """

    def __init__(self, accepts: Callable[[Any], bool], name: str, *, is_noun: bool = False) -> None:
        self.accepts, self.name, self.is_noun = accepts, name, is_noun


_ANYTHING = _Kind(lambda value: True, "")
_COLLECTING = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
_BY_PLACE = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


def _resolved(annotation: object, names: dict[str, Any]) -> object:
    if not isinstance(annotation, str):
        return annotation
    try:
        return eval(annotation, names)  # the text of this package's own annotations
    except (NameError, TypeError):
        return Any  # imported for type checkers alone


def _kind(hint: Any) -> _Kind:  # noqa: ANN401
    simple = {
        int: _Kind(is_whole, "a whole number"),
        float: _Kind(_is_real, "a finite number"),
        bool: _Kind(lambda value: isinstance(value, bool) or is_of_numpy(value, "bool_"), "True or False"),
        str: _Kind(lambda value: isinstance(value, str), "text"),
        None: _Kind(lambda value: value is None, "None"),
        type(None): _Kind(lambda value: value is None, "None"),
    }
    origin, parts = get_origin(hint), get_args(hint)
    if hint is Any or hint is object or hint == loaded("numpy.typing", "ArrayLike"):
        return _ANYTHING
    if origin is None:
        if hint in simple:
            return simple[hint]
        if isinstance(hint, type) and not getattr(hint, "_is_protocol", False) and hint is not inspect.Parameter.empty:
            return _Kind(lambda value: isinstance(value, hint), hint.__name__, is_noun=True)
        return _ANYTHING
    if origin is Literal:
        # True equals 1, and an array equals nothing in particular
        return _Kind(lambda value: any(type(value) is type(part) and value == part for part in parts), _either(parts))
    if origin in (Union, types.UnionType):
        return _union([_kind(part) for part in parts])
    if origin is PathLike:
        return _Kind(lambda value: isinstance(value, PathLike), "a path", is_noun=True)
    if origin is Callable:
        return _Kind(callable, "a function", is_noun=True)
    return _container(origin, [_kind(part) for part in parts if part is not Ellipsis], Ellipsis in parts)


def _either(choices: Sequence[object]) -> str:
    return ", ".join(map(repr, choices[:-1])) + f" or {choices[-1]!r}" if len(choices) > 1 else repr(choices[0])


def _union(kinds: Sequence[_Kind]) -> _Kind:
    if any(kind is _ANYTHING for kind in kinds):
        return _ANYTHING
    names = " or ".join(dict.fromkeys(kind.name for kind in kinds if kind.name != "None"))
    noun = any(kind.is_noun for kind in kinds)
    return _Kind(lambda value: any(kind.accepts(value) for kind in kinds), names, is_noun=noun)


def _container(origin: type, kinds: Sequence[_Kind], any_length: bool) -> _Kind:
    if origin is Mapping or origin is dict:
        of_keys, of_values = kinds

        def maps(value: Any) -> bool:  # noqa: ANN401
            return isinstance(value, Mapping) and all(
                of_keys.accepts(key) and of_values.accepts(each) for key, each in value.items()
            )

        return _Kind(maps, f"a dict of {_plural(of_values.name)} by {of_keys.name or 'key'}", is_noun=True)
    if origin in (list, Sequence) or (origin is tuple and any_length):
        kind = kinds[0]
        return _Kind(
            # no array holds instances of classes, least of all one without rows
            lambda value: (
                _is_sequence(value)
                and not (kind.is_noun and is_of_numpy(value, "ndarray"))
                and all(map(kind.accepts, value))
            ),
            f"a list of {_plural(kind.name)}",
            is_noun=kind.is_noun,
        )
    if origin is Iterable:
        # one that is used up by looking at it is taken as it is
        kind = kinds[0]
        return _Kind(
            lambda value: all(map(kind.accepts, value)) if _is_sequence(value) else _is_iterable(value),
            f"a list of {_plural(kind.name)}",
            is_noun=kind.is_noun,
        )
    return _ANYTHING  # arrays, pairs, and what else says too little


def _plural(name: str) -> str:
    return f"{name.removeprefix('a ')}s" if name.startswith("a ") else name or "values"


def _is_real(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _is_sequence(value: object) -> bool:
    if is_of_numpy(value, "ndarray"):
        return bool(value.ndim)  # type: ignore[attr-defined]
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _is_iterable(value: object) -> bool:
    return isinstance(value, Iterable) and not isinstance(value, str | bytes) and not is_of_numpy(value, "ndarray")


def _unknown(word: str, callee: Callable[..., Any], parameters: Iterable[str]) -> TypeError:
    known = [name for name in parameters if name not in ("self", "cls")]
    hint = did_you_mean(word, known) or f"; expected {', '.join(known) or 'none'}"
    name = callee.__qualname__.removesuffix(".__init__")
    return TypeError(f"{name}() got an unexpected keyword argument {word!r}{hint}")


def _refused(name: str, value: object, kind: _Kind, error: type[InputError] | None) -> InputError:
    if not kind.is_noun:
        return (error or ParameterError)(f"{name}: got {shown(value)}, expected {kind.name}")
    mend = next((f"; {MAKERS[word]}" for word in kind.name.split() if word in MAKERS), "")
    listed = value if isinstance(value, list | tuple) else ()
    inside = next((each for each in listed if not kind.accepts([each])), None)
    found = type(value).__name__ if inside is None else f"{type(inside).__name__} in a {type(value).__name__}"
    of_kind = ParameterError if kind.name == "Params" else InputError
    return (error or of_kind)(f"{name}: expected {kind.name}, got {found}{mend}")
