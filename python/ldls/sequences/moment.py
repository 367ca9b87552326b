"""The points of a sweep in the world, by object, and the boxes of the objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ldls.camera.rigid import transformed
from ldls.cloud import Floats, Ints
from ldls.segmentation import Segmentation
from ldls.sequences.sweeps import Sweep


class Boxes(NamedTuple):
    """The boxes of objects, along the axes of the world.

    Attributes:
        numbers: (k,) that of each object.
        low: (k, 3) least x y z of its points, in metres.
        high: (k, 3) largest.
    """

    numbers: Ints
    low: Floats
    high: Floats

    @classmethod
    def around(cls, numbers: Ints, low: Floats, high: Floats) -> Self:
        """That of each number around all boxes (n, 3), or points, that have it."""
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
        if not len(starts):
            return cls(numbers, low, high)
        each = numbers[order[starts]]
        return cls(each, np.minimum.reduceat(low[order], starts), np.maximum.reduceat(high[order], starts))

    def of(self, numbers: Sequence[int]) -> Self:
        """Those of objects of these numbers, which must be there."""
        return self.some(np.searchsorted(self.numbers, numbers))

    def some(self, at: NDArray[np.bool_] | Ints) -> Self:
        """Those at some places, or where a mask (k,) is true."""
        return type(self)(self.numbers[at], self.low[at], self.high[at])

    def longer(self, by_m: float) -> Self:
        """Boxes that reach so many metres farther at each end."""
        return self._replace(low=self.low - by_m, high=self.high + by_m)

    def hold(self, points: Floats) -> list[Ints]:
        """Indices of the points (n, 3) that each box holds, where points are in the order of x."""
        x, y, z = points.T
        starts, ends = np.searchsorted(x, self.low[:, 0]), np.searchsorted(x, self.high[:, 0], "right")
        held = []
        for start, end, low, high in zip(starts.tolist(), ends.tolist(), self.low, self.high, strict=True):
            y_of, z_of = y[start:end], z[start:end]
            inside = (y_of >= low[1]) & (y_of <= high[1]) & (z_of >= low[2]) & (z_of <= high[2])
            held.append(start + np.flatnonzero(inside))
        return held


@dataclass(frozen=True, eq=False)
class Moment:
    """The points of a sweep that are in view, in the world.

    Attributes:
        stamp: Time of the sweep in seconds.
        points: (n, 3) x y z in metres, in the order of x.
        tracks: (n,) number of the object of each point; 0 of none.
        rows: (n,) row of each in the points of its sweep.
        blind: True if no image shows anything.
    """

    stamp: float
    points: Floats
    tracks: Ints
    rows: Ints
    blind: bool

    @classmethod
    def of(cls, sweep: Sweep, result: Segmentation, numbers: Mapping[int, int]) -> Self:
        """The moment of a sweep whose labels stand for objects of these `numbers`."""
        xyz = transformed(result.points[result.in_view], sweep.pose)
        order = np.argsort(xyz[:, 0])
        xyz, rows = xyz[order], result.in_view[order]
        of_label = np.zeros(len(result.instances) + 1, np.int64)
        of_label[list(numbers)] = list(numbers.values())
        tracks = of_label[np.maximum(result.labels[rows], 0)]
        blind = not any(instance.sources for instance in result.instances)
        return cls(sweep.stamp, xyz, tracks, rows, blind)

    @cached_property
    def counts(self) -> Ints:
        """(largest number + 1,) points of each object by its number; at 0 those of none."""
        return np.bincount(self.tracks)

    def counts_of(self, numbers: Sequence[int]) -> Ints:
        """(k,) points of objects of k numbers, which need not be there."""
        return np.append(self.counts, 0)[np.minimum(numbers, len(self.counts))]

    @cached_property
    def free(self) -> Ints:
        """(m,) indices of the points of no object."""
        return np.flatnonzero(self.tracks == 0)

    @cached_property
    def free_points(self) -> Floats:
        """(m, 3) the points of no object, in metres, in the order of x."""
        return self.points[self.free]

    @cached_property
    def labelled(self) -> Ints:
        """Indices of the points of objects."""
        return np.flatnonzero(self.tracks)

    @cached_property
    def boxes(self) -> Boxes:
        """Those of the objects."""
        own = self.points[self.labelled]
        return Boxes.around(self.tracks[self.labelled], own, own)

    def some(self, rows: Ints) -> tuple[Floats, Ints]:
        """Points at some rows, and the number of the object of each."""
        return self.points[rows], self.tracks[rows]

    def renumbered(self, number: int, other: int) -> Self:
        """The same, where an object of a number has another, which may be there too."""
        if self.counts_of([number]) == 0:
            return self
        return replace(self, tracks=np.where(self.tracks == number, other, self.tracks))
