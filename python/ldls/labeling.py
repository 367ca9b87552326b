"""Labels of the points of one frame, by a method or a person."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.errors import DtypeError, InputError, ShapeError

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation

BACKGROUND = "background"
MAX_LABEL = 2**31 - 1


@dataclass(frozen=True, eq=False)
class Labeling:
    """Class and instance of each of N points.

    Attributes:
        classes: (N,) int32: index into `names`; 0 is background.
        instances: (N,) int32: 0 none. A pair (class, instance) names an instance, so that the first car and the first
            pedestrian may both be 1.
        ignored: (N,) bool: points that no score counts, such as those out of the camera's view. Scores leave out what
            truth or prediction ignores, so methods compared with one another must ignore the same points.
        names: Class names; the first is "background".

    Raises:
        ShapeError: The arrays are not (N,) of one length.
        DtypeError: Classes or instances are not whole numbers, or `ignored` is not boolean.
        InputError: A class is no index into `names`, an instance is negative, or `names` repeat themselves.
    """

    classes: NDArray[np.int32]
    instances: NDArray[np.int32]
    ignored: NDArray[np.bool_]
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        names = tuple(self.names)
        if names[:1] != (BACKGROUND,) or len(set(names)) != len(names):
            raise InputError(f"names: got {names}, expected 'background' first and every name once")
        object.__setattr__(self, "names", names)
        length = np.shape(self.classes)
        for name, highest in (("classes", len(names) - 1), ("instances", MAX_LABEL)):
            object.__setattr__(self, name, _whole_numbers(name, getattr(self, name), length, highest))
        ignored = np.asarray(self.ignored)
        _check_shape("ignored", ignored, length)
        if ignored.dtype != np.bool_:
            raise DtypeError(f"ignored: expected bool, got {ignored.dtype}")
        object.__setattr__(self, "ignored", ignored)

    @classmethod
    def from_codes(
        cls, codes: NDArray[Any], table: Mapping[int, str], *, instances: NDArray[Any] | None = None
    ) -> Self:
        """Labels from a data set's class numbers `codes` (N,) and their names.

        Raises:
            InputError: A number has no name; the message names the point.
        """
        names = (BACKGROUND, *(name for name in table.values() if name != BACKGROUND))
        lookup = np.full(max(table) + 2, -1, np.int32)
        lookup[list(table)] = [names.index(name) for name in table.values()]
        # the last entry, which no number of the table reaches, stands for all that are out of range
        inside = (codes >= 0) & (codes <= max(table))
        classes = lookup[np.where(inside, codes, len(lookup) - 1).astype(np.int64)]
        if (classes < 0).any():
            first = int((classes < 0).argmax())
            raise InputError(f"point {first} has class {codes[first]}, expected one of {', '.join(map(str, table))}")
        none = np.zeros(len(classes), np.int32)
        return cls(classes, none if instances is None else instances, none.astype(bool), names)

    @classmethod
    def from_segmentation(cls, result: Segmentation) -> Self:
        """Labels of a segmentation, its instances by their masks; points out of view are ignored."""
        return cls.from_instance_labels(result.labels, [instance.name for instance in result.instances])

    @classmethod
    def from_instance_labels(cls, labels: NDArray[np.signedinteger], class_names: Iterable[str]) -> Self:
        """Labels of points by instance, (N,): -1 ignored, 0 background, m of class `class_names[m - 1]`.

        Raises:
            InputError: A label has no name.
        """
        objects = [str(name) for name in class_names]
        if labels.size and not (labels.min() >= -1 and labels.max() <= len(objects)):
            raise InputError(f"labels: got {labels.min()} to {labels.max()}, expected -1 to {len(objects)}")
        names = tuple(dict.fromkeys([BACKGROUND, *objects]))
        instances = np.maximum(labels, 0)
        by_label = np.array([0, *(names.index(name) for name in objects)], np.int32)
        return cls(by_label[instances], instances, labels < 0, names)

    def __len__(self) -> int:
        return len(self.classes)

    def __repr__(self) -> str:
        classes = [name for name, count in self.counts().items() if count and name != BACKGROUND]
        return f"Labeling({len(self)} points, {int(self.ignored.sum())} ignored, classes {classes})"

    def counts(self) -> dict[str, int]:
        """Points of each class that are not ignored."""
        numbers = np.bincount(self.classes[~self.ignored], minlength=len(self.names))
        return dict(zip(self.names, numbers.tolist(), strict=True))

    def restricted(self, keep: ArrayLike) -> Labeling:
        """This labeling with every point outside `keep`, (N,) bool, ignored as well."""
        inside = np.asarray(keep)
        _check_shape("keep", inside, self.classes.shape)
        if inside.dtype != np.bool_:
            raise DtypeError(f"keep: expected bool, got {inside.dtype}")
        return replace(self, ignored=self.ignored | ~inside)


def _whole_numbers(name: str, values: ArrayLike, shape: tuple[int, ...], highest: int) -> NDArray[np.int32]:
    array = np.asarray(values)
    _check_shape(name, array, shape)
    if array.dtype.kind not in "iu":
        raise DtypeError(f"{name}: expected whole numbers, got {array.dtype}; pass {name}.astype(numpy.int32)")
    if array.size and not (array.min() >= 0 and array.max() <= highest):
        raise InputError(f"{name}: got {array.min()} to {array.max()}, expected 0 to {highest}")
    return array.astype(np.int32, copy=False)


def _check_shape(name: str, array: NDArray[Any], expected: tuple[int, ...]) -> None:
    if array.ndim != 1 or array.shape != expected:
        raise ShapeError(f"{name}: expected ({expected[0] if expected else 'N'},), got {array.shape}; one a point")
