"""What is known of an object of a drive, and where it is at a moment: it goes on by a constant velocity, or stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ldls._optional import require
from ldls.cloud import Floats
from ldls.segmentation import Instance
from ldls.sequences.trajectory import SAME_S

MEMORY_S = 2.0
"""Time over which a velocity is constant, and labels go on."""
SLOWEST_M_S = 0.5
"""What is slower stands still."""
FASTEST_M_S = 60.0
"""What is faster is not one object at all times."""
MOVES = 0.5
"""Share of the distance between the points of two moments that a motion may leave: the middle of what is visible of a
standing object moves too, but its points stay where they are. And share of the variance of the middles: they jump where
another part becomes visible, and lie on no line."""

Box = tuple[float, float, float, float]
"""Least x and y, and largest, in metres."""


@dataclass(frozen=True, eq=False)
class Footprint:
    """The points of an object from above.

    Attributes:
        points: (n, 2) x y in the world, in metres.
    """

    points: Floats

    @cached_property
    def box(self) -> Box:
        """The smallest box that holds them."""
        (left, below), (right, above) = self.points.min(axis=0).tolist(), self.points.max(axis=0).tolist()
        return left, below, right, above

    @cached_property
    def middle(self) -> Floats:
        """(2,) median x and y, in metres."""
        in_order = np.sort(self.points, axis=0)  # NumPy's median takes four times as long for so few
        middle: Floats = (in_order[(len(in_order) - 1) // 2] + in_order[len(in_order) // 2]) / 2
        return middle

    @cached_property
    def length(self) -> float:
        """Diagonal of the box, in metres."""
        left, below, right, above = self.box
        return math.hypot(right - left, above - below)


class Sighting(NamedTuple):
    """An object at a moment.

    Attributes:
        stamp: When, in seconds.
        footprint: Where.
        shown: True if an image has a mask of it.
    """

    stamp: float
    footprint: Footprint
    shown: bool


@dataclass(eq=False)
class Track:
    """What is known of an object.

    Attributes:
        number: Its number.
        instance: As what it was seen last.
        n_images: Sweeps of which an image had a mask of it.
        sightings: Those of the last two seconds in which it was seen.
    """

    number: int
    instance: Instance
    n_images: int = 0
    sightings: list[Sighting] = field(default_factory=list)

    @property
    def stamp(self) -> float:
        """When it was seen last, in seconds."""
        return self.sightings[-1].stamp

    @property
    def most_points(self) -> int:
        """Points of the sighting that has the most."""
        return max(len(each.footprint.points) for each in self.sightings)

    @property
    def length(self) -> float:
        """Length of the longest sighting, in metres."""
        return max(each.footprint.length for each in self.sightings)

    @cached_property
    def velocity(self) -> Floats:
        """(2,) x y in the world, in metres a second; zeros where it stands."""
        return _velocity(self.sightings)

    @property
    def moves(self) -> bool:
        """True if it does not stand."""
        return bool(self.velocity.any())

    def advance(self, instance: Instance, sighting: Sighting) -> None:
        """Note that it was seen again."""
        self.instance = instance
        # two labels of a sweep may be of it
        known = any(each.shown and each.stamp == sighting.stamp for each in self.sightings)
        self.n_images += sighting.shown and not known
        first = sighting.stamp - MEMORY_S - SAME_S
        self.sightings = [*(each for each in self.sightings if each.stamp >= first), sighting]
        # found anew when they are asked for, which is not after every sweep
        for name in ("velocity", "_place"):
            self.__dict__.pop(name, None)

    def as_instance(self, instance: Instance) -> Instance:
        """The instance with number and velocity."""
        x, y = self.velocity.tolist()
        return replace(instance, track=self.number, velocity=(x, y))

    def shown_with(self, other: Track) -> int:
        """Sweeps of the last two seconds of whose images each has a mask of its own."""
        own, others = ({each.stamp for each in track.sightings if each.shown} for track in (self, other))
        return len(own & others)

    def at(self, stamp: float) -> Footprint:
        """Where the points of all its sightings are at a moment."""
        return brought(self.sightings, self.velocity, stamp) if self.moves else self._place

    @cached_property
    def _place(self) -> Footprint:
        """The points of all its sightings, where they were."""
        return Footprint(np.concatenate([each.footprint.points for each in self.sightings]))


def brought(sightings: Sequence[Sighting], velocity: Floats, stamp: float) -> Footprint:
    """Where the points of all sightings are at a moment, at a velocity."""
    return Footprint(np.concatenate([own.points + velocity * (stamp - then) for then, own, _ in sightings]))


def gap(one: Box, other: Box) -> float:
    """How far apart boxes are along one axis at least, in metres; below 0 where they overlap."""
    return max(one[0] - other[2], other[0] - one[2], one[1] - other[3], other[1] - one[3])


def _velocity(sightings: Sequence[Sighting]) -> Floats:
    """The slope of a line through the middles, or zeros.

    It is believed if the middles lie near the line, and the first points, moved so, on the last. A middle counts by its
    points: that of a few is of some corner of the object.
    """
    stamps = np.array([each.stamp - sightings[-1].stamp for each in sightings])
    counts = np.array([len(each.footprint.points) for each in sightings])
    shares = counts / counts.sum()
    since = stamps - shares @ stamps
    spread = float(shares @ since**2)
    if spread == 0:
        return np.zeros(2)
    middles = np.array([each.footprint.middle for each in sightings])
    middles -= shares @ middles
    slope: Floats = shares * since @ middles / spread
    speed = math.hypot(*slope.tolist())
    along_line, variance = spread * speed**2, float(shares @ np.sum(middles**2, axis=1))
    if not SLOWEST_M_S <= speed <= FASTEST_M_S or along_line < (1 - MOVES) * variance:
        return np.zeros(2)
    first, last = sightings[0], sightings[-1]
    way = slope * (last.stamp - first.stamp)
    begin, end = first.footprint.points, last.footprint.points
    return slope if _mean_distance(begin + way, end) < MOVES * _mean_distance(begin, end) else np.zeros(2)


def _mean_distance(one: Floats, other: Floats) -> float:
    """Mean distance in metres of the points of one to the nearest of the other.

    It is the less of both ways: of a standing object more may be visible at one of the moments.
    """
    squared = squared_distances(one, other)
    return float(min(np.sqrt(squared.min(axis=0)).mean(), np.sqrt(squared.min(axis=1)).mean()))


def squared_distances(one: Floats, other: Floats) -> Floats:
    """(n, m) squared distance of each of n points from each of m, in square metres: of so few, a tree takes longer."""
    squared: Floats = require("scipy.spatial.distance", "eval").cdist(one, other, "sqeuclidean")
    return squared
