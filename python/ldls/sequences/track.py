"""What is known of an object of a drive, and where it is at a moment: it goes on by a constant velocity."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ldls.segmentation import Instance

MEMORY_S = 2.0
"""Time over which a velocity is constant."""
SLOWEST_M_S = 0.5
"""What is slower stands still: the middle of what is visible of it moves."""
FASTEST_M_S = 60.0
"""What is faster is not one object at all times."""

Floats = NDArray[np.float64]


@dataclass(eq=False)
class Track:
    """What is known of an object.

    Attributes:
        number: Its number.
        instance: As what it was seen last.
        points: (n, 2) where it was seen last: x y of its points in the world, in metres.
        n_images: Sweeps of which an image had a mask of it.
        middles: Its places over the last seconds: stamp in seconds and (2,) median of its points, in metres.
    """

    number: int
    instance: Instance
    points: Floats
    n_images: int = 0
    middles: list[tuple[float, Floats]] = field(default_factory=list)

    @property
    def stamp(self) -> float:
        """When it was seen last, in seconds."""
        return self.middles[-1][0]

    def advance(self, stamp: float, instance: Instance, points: Floats) -> None:
        """Note that it was seen."""
        self.instance, self.points = instance, points
        self.n_images += bool(instance.sources)
        self.middles = [(then, middle) for then, middle in self.middles if stamp - then <= MEMORY_S]
        self.middles.append((stamp, np.median(points, axis=0)))

    def velocity(self) -> Floats:
        """(2,) metres a second: the slope of a line through its places."""
        stamps = np.array([stamp for stamp, _ in self.middles])
        since = stamps - stamps.mean()
        spread = float(since @ since)
        if spread == 0:
            return np.zeros(2)
        slope: Floats = since @ np.array([middle for _, middle in self.middles]) / spread
        return slope if SLOWEST_M_S <= np.linalg.norm(slope) <= FASTEST_M_S else np.zeros(2)

    def as_instance(self, instance: Instance) -> Instance:
        """The instance with number and velocity."""
        x, y = self.velocity().tolist()
        return replace(instance, track=self.number, velocity=(x, y))

    def at(self, stamp: float) -> Floats:
        """(n, 2) where its points are at a moment, in metres."""
        return self.points + self.velocity() * (stamp - self.stamp)
