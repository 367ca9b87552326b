"""The points of a sweep in the world, by object, and the boxes of the objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ldls.camera.rigid import transformed
from ldls.segmentation import Segmentation
from ldls.sequences.sweeps import Sweep
from ldls.sequences.track import Floats

Ints = NDArray[np.int64]


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
        each, starts = np.unique(numbers[order], return_index=True)
        if not len(each):
            return cls(each, low, high)
        return cls(each, np.minimum.reduceat(low[order], starts), np.maximum.reduceat(high[order], starts))

    def hold(self, points: Floats, some: NDArray[np.bool_], around_m: float) -> NDArray[np.bool_]:
        """(n,) whether any of `some` (k,) boxes, longer by so many metres at each end, holds each of points (n, 3)."""
        held = np.zeros(len(points), bool)
        for low, high in zip(self.low[some], self.high[some], strict=True):
            held |= np.all((points >= low - around_m) & (points <= high + around_m), axis=1)
        return held


@dataclass(frozen=True, eq=False)
class Moment:
    """The points of a sweep that are in view, in the world.

    Attributes:
        stamp: Time of the sweep in seconds.
        points: (n, 3) x y z in metres, all x before all y in memory.
        tracks: (n,) number of the object of each point; 0 of none.
        rows: (n,) row of each in the points of its sweep.
        counts: Points of each object.
        blind: True if no image shows anything.
    """

    stamp: float
    points: Floats
    tracks: Ints
    rows: Ints
    counts: Mapping[int, int]
    blind: bool

    @classmethod
    def of(cls, sweep: Sweep, result: Segmentation, numbers: Mapping[int, int]) -> Self:
        """The moment of a sweep whose labels stand for objects of these `numbers`."""
        rows = result.in_view
        xyz = np.asfortranarray(transformed(result.points[rows], sweep.pose))
        of_label = np.zeros(len(result.instances) + 1, np.int64)
        of_label[list(numbers)] = list(numbers.values())
        tracks = of_label[np.maximum(result.labels[rows], 0)]
        counts = np.bincount(tracks)
        each = 1 + np.flatnonzero(counts[1:])
        blind = not any(instance.sources for instance in result.instances)
        return cls(sweep.stamp, xyz, tracks, rows, dict(zip(each.tolist(), counts[each].tolist(), strict=True)), blind)

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
        counts = dict(self.counts)
        if (count := counts.pop(number, 0)) == 0:
            return self
        counts[other] = counts.get(other, 0) + count
        return replace(self, tracks=np.where(self.tracks == number, other, self.tracks), counts=counts)

    def within(self, low: Floats, high: Floats) -> Ints:
        """Indices of the points in a box."""
        x = self.points[:, 0]
        inside: Ints = np.flatnonzero((x >= low[0]) & (x <= high[0]))
        _, y, z = self.points[inside].T
        inside = inside[(y >= low[1]) & (y <= high[1]) & (z >= low[2]) & (z <= high[2])]
        return inside
