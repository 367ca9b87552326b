"""The objects of a drive: one number for each in all sweeps, through gaps of some seconds.

Seen from above, an object goes on as itself where its points lie near those of a track, moved to the moment by its
velocity, which is constant over some seconds. Pairs are chosen together (linear assignment), so that neighbours do not
swap. Within sweeps that were segmented together an object keeps its label, and so its number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.checks import checked
from ldls.errors import InputError
from ldls.segmentation import Instance, Segmentation
from ldls.sequences.sweeps import Sweep

LONGEST_GAP_S = 5.0
"""Time without a point after which a track ends."""
NEAR_M = 2.0
"""Distance from above up to which an object may be a track."""
MEMORY_S = 2.0
"""Time over which a velocity is constant."""
SLOWEST_M_S = 0.5
"""What is slower stands still: the middle of what is visible of it moves."""
MOST_POINTS = 256
"""Floats that stand for an object; of more, some."""

Floats = NDArray[np.float64]


@dataclass(eq=False)
class _Track:
    """What is known of an object: its number, and where it was, in metres seen from above."""

    number: int
    category: int
    points: Floats
    middles: list[tuple[float, Floats]] = field(default_factory=list)

    @property
    def stamp(self) -> float:
        return self.middles[-1][0]

    def advance(self, stamp: float, points: Floats) -> None:
        self.points = points
        self.middles = [(then, middle) for then, middle in self.middles if stamp - then <= MEMORY_S]
        self.middles.append((stamp, np.median(points, axis=0)))

    def velocity(self) -> Floats:
        """Metres a second: the slope of a line through its places."""
        stamps = np.array([stamp for stamp, _ in self.middles])
        since = stamps - stamps.mean()
        spread = float(since @ since)
        if spread == 0:
            return np.zeros(2)
        slope: Floats = since @ np.array([middle for _, middle in self.middles]) / spread
        return slope if np.linalg.norm(slope) >= SLOWEST_M_S else np.zeros(2)

    def at(self, stamp: float) -> Floats:
        return self.points + self.velocity() * (stamp - self.stamp)


class Tracker:
    """Numbers the objects of a drive, sweep after sweep.

    Memory is that of the objects of the last seconds.

    Examples:
        >>> tracker = ldls.Tracker()  # doctest: +SKIP
        >>> for sweeps in windows:  # doctest: +SKIP
        ...     results = tracker.track(sweeps, ldls.segment_sweeps(sweeps))
    """

    def __init__(self) -> None:
        """Start a drive.

        Raises:
            ImportError: `ldls[eval]` is not installed.
        """
        self._assign = require("scipy.optimize", "eval").linear_sum_assignment
        self._tree = require("scipy.spatial", "eval").KDTree
        self._tracks: list[_Track] = []
        self._count = 0
        self._stamp = -np.inf

    @checked
    def track(self, sweeps: Sequence[Sweep], results: Sequence[Segmentation]) -> tuple[Segmentation, ...]:
        """Return the results with track and velocity of each instance that has points in any of the sweeps.

        Args:
            sweeps: The next sweeps of the drive, in the order of their stamps.
            results: What `segment_sweeps` says of them together.

        Raises:
            InputError: There is not one result a sweep, or a sweep is not later than the one before it.
        """
        if len(sweeps) != len(results):
            raise InputError(f"results: got {len(results)}, expected {len(sweeps)}, one a sweep")
        for before, stamp in pairwise([self._stamp, *(sweep.stamp for sweep in sweeps)]):
            if not stamp > before:
                raise InputError(f"sweeps: one of {stamp} s comes after one of {before} s; sort them by their stamps")
        by_label: dict[int, _Track] = {}
        for sweep, result in zip(sweeps, results, strict=True):
            self._stamp = sweep.stamp
            self._follow(sweep, result, by_label)
        known = {label: (track.number, track.velocity().tolist()) for label, track in by_label.items()}

        def tracked(instance: Instance) -> Instance:
            number, (x, y) = known.get(instance.label, (0, (0.0, 0.0)))
            return replace(instance, track=number, velocity=(x, y))

        return tuple(replace(result, instances=tuple(map(tracked, result.instances))) for result in results)

    def _follow(self, sweep: Sweep, result: Segmentation, by_label: dict[int, _Track]) -> None:
        """Take the tracks one sweep further; `by_label` has those of the labels that are known."""
        self._tracks = [track for track in self._tracks if sweep.stamp - track.stamp <= LONGEST_GAP_S]
        objects = _objects(sweep, result)
        categories = {instance.label: instance.category for instance in result.instances}
        new = [label for label in objects if label not in by_label]
        taken = {id(by_label[label]) for label in objects if label in by_label}
        free = [track for track in self._tracks if id(track) not in taken]
        places = [track.at(sweep.stamp) for track in free]
        costs = np.full((len(new), len(free)), np.inf)
        for i, label in enumerate(new):
            for j, (track, place) in enumerate(zip(free, places, strict=True)):
                if categories[label] == track.category:
                    costs[i, j] = self._apart(objects[label], place)
        # what cannot be is dearer than all that can be together
        dearest = NEAR_M * (len(new) + 1)
        rows, columns = self._assign(np.where(np.isfinite(costs), costs, dearest))
        for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
            if np.isfinite(costs[i, j]):
                by_label[new[i]] = free[j]
        for label, points in objects.items():
            if label not in by_label:
                self._count += 1
                by_label[label] = _Track(self._count, categories[label], points)
            track = by_label[label]
            track.advance(sweep.stamp, points)
            if track not in self._tracks:
                self._tracks.append(track)

    def _apart(self, one: Floats, other: Floats) -> float:
        """How far apart objects are in metres, infinite beyond `NEAR_M`.

        It is the mean of two distances: of the points of the smaller to the nearest of the other, and of the middles.
        """
        gap = np.maximum(one.min(axis=0) - other.max(axis=0), other.min(axis=0) - one.max(axis=0)).max()
        if gap > NEAR_M:
            return float("inf")
        few, many = sorted((one, other), key=len)
        distances, _ = self._tree(many).query(few)
        if distances.min() > NEAR_M:
            return float("inf")
        middle = np.linalg.norm(np.median(one, axis=0) - np.median(other, axis=0))
        return float(np.minimum(distances, NEAR_M).mean() + min(middle, NEAR_M)) / 2


def _objects(sweep: Sweep, result: Segmentation) -> dict[int, Floats]:
    """The points of each label that has some, in the world, seen from above."""
    labelled = np.flatnonzero(result.labels > 0)
    labelled = labelled[np.argsort(result.labels[labelled], kind="stable")]
    labels, starts = np.unique(result.labels[labelled], return_index=True)
    objects = {}
    for label, rows in zip(labels.tolist(), np.split(labelled, starts)[1:], strict=True):
        some = rows[:: -(-len(rows) // MOST_POINTS)]
        xyz = result.points[some, :3].astype(np.float64)
        objects[label] = xyz @ sweep.pose[:2, :3].T + sweep.pose[:2, 3]
    return objects
