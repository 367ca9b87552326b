"""Labels of the points of one frame, by a method or a person."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.by_value import ByValue
from ldls.checks import as_array, checked, numbers, shown
from ldls.errors import InputError, ShapeError
from ldls.segmentation import Segmentation

BACKGROUND = "background"
MAX_LABEL = 2**31 - 1
MOST_CODES = 65_535
"""Largest class number of a data set: they have 16 bits."""


@checked
@dataclass(frozen=True, eq=False)
class Labeling(ByValue):
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
        count = len(as_array("classes", self.classes).ravel())
        for name, highest in (("classes", len(names) - 1), ("instances", MAX_LABEL)):
            values = numbers(name, getattr(self, name), np.int64, (count,))
            if count and not (values.min() >= 0 and values.max() <= highest):
                raise InputError(f"{name}: got {values.min()} to {values.max()}, expected 0 to {highest}")
            object.__setattr__(self, name, values.astype(np.int32))
        object.__setattr__(self, "ignored", numbers("ignored", self.ignored, np.bool_, (count,)).copy())

    @classmethod
    @checked
    def from_codes(
        cls, codes: NDArray[Any], table: Mapping[int, str], *, instances: NDArray[Any] | None = None
    ) -> Self:
        """Labels from a data set's class numbers `codes` (N,) and their names.

        Raises:
            InputError: A number has no name; the message names the point.
        """
        if not table or not all(0 <= number <= MOST_CODES for number in table):
            raise InputError(f"table: got {shown(table)}, expected names of class numbers from 0 to {MOST_CODES}")
        codes = as_array("codes", codes)
        if codes.ndim != 1 or codes.dtype.kind not in "iuf":  # whole numbers, which some data sets keep as floats
            raise ShapeError(f"codes: expected (N,) whole numbers, got {codes.dtype} {codes.shape}")
        names = tuple(dict.fromkeys([BACKGROUND, *table.values()]))
        lookup = np.full(max(table) + 2, -1, np.int32)
        lookup[list(table)] = [names.index(name) for name in table.values()]
        # the last entry, which no number of the table reaches, stands for all that are out of range
        inside = (codes >= 0) & (codes <= max(table)) & (codes == np.floor(codes))
        classes = lookup[np.where(inside, codes, len(lookup) - 1).astype(np.int64)]
        if (classes < 0).any():
            first = int((classes < 0).argmax())
            raise InputError(f"point {first} has class {codes[first]}, expected one of {', '.join(map(str, table))}")
        none = np.zeros(len(classes), np.int32)
        return cls(classes, none if instances is None else instances, none.astype(bool), names)

    @classmethod
    @checked
    def from_segmentation(cls, result: Segmentation) -> Self:
        """Labels of a segmentation, its instances by label or track; points out of view are ignored."""
        names = [instance.name for instance in result.instances]
        return cls.from_instance_labels(result.labels, names, instance_ids=result.instance_ids[1:])

    @classmethod
    @checked
    def from_instance_labels(
        cls,
        labels: NDArray[np.signedinteger],
        class_names: Iterable[str],
        *,
        instance_ids: ArrayLike | None = None,
    ) -> Self:
        """Labels of points by instance, (N,): -1 ignored, 0 background, m of class `class_names[m - 1]`.

        Its instance is m, or `instance_ids[m - 1]`, as the number of a track.

        Raises:
            InputError: A label has no name.
            ShapeError: There is not one number a name.
        """
        objects = [str(name) for name in class_names]
        labels = numbers("labels", labels, np.int32, ("N",))
        if labels.size and not (labels.min() >= -1 and labels.max() <= len(objects)):
            raise InputError(f"labels: got {labels.min()} to {labels.max()}, expected -1 to {len(objects)}")
        names = tuple(dict.fromkeys([BACKGROUND, *objects]))
        known = np.maximum(labels, 0)
        by_label = np.array([0, *(names.index(name) for name in objects)], np.int32)
        ids = np.arange(1, len(objects) + 1) if instance_ids is None else instance_ids
        numbered = np.concatenate([[0], numbers("instance_ids", ids, np.int64, (len(objects),))])
        return cls(by_label[known], numbered[known], labels < 0, names)

    def __len__(self) -> int:
        return len(self.classes)

    def __repr__(self) -> str:
        classes = [name for name, count in self.counts().items() if count and name != BACKGROUND]
        return f"Labeling({len(self)} points, {int(self.ignored.sum())} ignored, classes {classes})"

    def counts(self) -> dict[str, int]:
        """Points of each class that are not ignored."""
        numbers = np.bincount(self.classes[~self.ignored], minlength=len(self.names))
        return dict(zip(self.names, numbers.tolist(), strict=True))

    @checked
    def restricted(self, keep: ArrayLike) -> Labeling:
        """This labeling with every point outside `keep`, (N,) bool, ignored as well."""
        inside = numbers("keep", keep, np.bool_, self.classes.shape)
        return replace(self, ignored=self.ignored | ~inside)
