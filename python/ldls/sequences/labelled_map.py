"""The labelled map of a drive: what stands still, in voxels.

Only points that an image sees are in it, for of others nobody knows whether they stand still, and only objects that
have not moved. Whether one has is known when the drive is over, and so the points of each object are kept apart: a
voxel has a row for each object with points in it, and the rows of those that moved are left out when the map is asked
for. The middle of a parked car's points goes metres while its visible side changes, but its points all lie in one
place, little longer than what the best of its sweeps shows. Hence the rule: an object has moved if the room of its
points over the drive is longer than that of its longest sweep by more than half of the latter, and `MOVED_M`. Of the
points of a sweep the outer tenth on each side does not count, for labels leak there. In two simulated drives parked
cars grow by up to 0.46 of their length, what drives by 0.6 and more, and of seven walkers two by less, whose tracks
are short. One sweep with a label on something else makes the longest long for good: so what its track says moves in
nine of ten sweeps has moved, too, if it has ten or more. In 16 simulated drives nothing that stands did so in more than
five.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ldls.camera.rigid import from_parts, transformed
from ldls.checks import checked
from ldls.cloud import Floats, Ints, is_finite
from ldls.errors import InputError, LimitError, ParameterError
from ldls.segmentation import Segmentation
from ldls.sequences.grid import cell_keys
from ldls.sequences.sweeps import Sweep, check_points

MOVED_M = 0.4
MOVED_SHARE = 0.5
"""The room of what moved grows by more than this, and by more than this share of what one sweep shows."""
MOVING_SWEEPS = 10
MOVING_SHARE = 0.9
"""What has a velocity in this share of its sweeps has moved, if it is seen in so many."""
OUTER = 10.0
"""Percent of an object's points of a sweep, on each side, that do not count for its room."""
LARGEST_VOXEL_M = 1000.0
MOST_ROWS = 20_000_000
"""Most rows, one for each voxel and object in it: some 1 GB, and thrice that for a moment while sweeps are added."""
ROWS_AT_ONCE = 1_000_000
"""Rows of new sweeps are kept until there are as many, or a quarter of those of the map, and then added together."""


class _Rows(NamedTuple):
    """Rows in ascending order of voxel and object, no pair twice.

    Attributes:
        voxels: (n,) keys.
        objects: (n,) numbers of objects; 0 is the background.
        counts: (n,) points.
        sums: (n, 3) of the points, in metres from the grid's origin.
        confidence: (n,) sum over the points.
    """

    voxels: Ints
    objects: Ints
    counts: Ints
    sums: Floats
    confidence: Floats


class _Voxels(NamedTuple):
    """What the map says of each voxel."""

    points: Floats
    categories: NDArray[np.int32]
    tracks: NDArray[np.int32]
    confidence: NDArray[np.float32]


@dataclass
class _Room:
    """The room of an object along x and y: lowest and highest place over the drive, and its longest sweep.

    Beside it, the sweeps with the object, and those in which it has a velocity.
    """

    low: Floats
    high: Floats
    longest: Floats
    n_sweeps: int = 0
    n_moving: int = 0

    @property
    def moved(self) -> bool:
        if self.n_sweeps >= MOVING_SWEEPS and self.n_moving >= MOVING_SHARE * self.n_sweeps:
            return True
        longest = float(np.linalg.norm(self.longest))
        return float(np.linalg.norm(self.high - self.low - self.longest)) > max(MOVED_M, MOVED_SHARE * longest)


class LabelledMap:
    """The places that stood still over a drive, each with the object that most of its points are of.

    Voxels are cubes of the world, which all poses share. Each has the mean of its points in view, and the category and
    track that most of them voted for; of equally many the background, then the lowest category and track. Points out of
    view are left out, and points of objects that moved: what they take up, seen from above, is over the drive longer by
    half than in any one sweep, and by 0.4 m, or their tracks have a velocity in nine of ten sweeps, of ten or more.
    Memory grows with the voxels.

    Attributes:
        voxel_m: Side of a voxel, in metres.

    Examples:
        >>> places = ldls.LabelledMap(voxel_m=0.1)  # doctest: +SKIP
        >>> for sweeps in windows:  # doctest: +SKIP
        ...     results = tracker.track(sweeps, ldls.segment_sweeps(sweeps))
        ...     for sweep, result in zip(sweeps, results):
        ...         places.add(sweep, result)
        >>> ldls.save(places, "map.ply")  # doctest: +SKIP
    """

    @checked
    def __init__(self, voxel_m: float = 0.1) -> None:
        """Start a map.

        Args:
            voxel_m: Side of a voxel, in metres.

        Raises:
            ParameterError: It is not above 0, or above 1,000.
        """
        if not 0 < voxel_m <= LARGEST_VOXEL_M:
            raise ParameterError(f"voxel_m: got {voxel_m}, expected metres above 0, at most {LARGEST_VOXEL_M:g}")
        self.voxel_m = float(voxel_m)
        self._origin: Floats | None = None
        none = np.zeros(0, np.int64)
        self._rows = _Rows(none, none, none, np.zeros((0, 3)), np.zeros(0))
        self._new: list[_Rows] = []
        self._numbers: dict[tuple[int, int], int] = {(0, 0): 0}
        self._rooms: dict[int, _Room] = {}
        self._voxels: _Voxels | None = None

    @checked
    def add(self, sweep: Sweep, result: Segmentation) -> None:
        """Add the points of a sweep that are in view.

        Args:
            sweep: The points, and where the lidar stood.
            result: Their labels, with the tracks that `Tracker.track` gives them.

        Raises:
            ShapeError: The result is of another number of points.
            InputError: The result is of other points, or an object has points and no track, so that nobody knows
                whether it moves.
            LimitError: A point is too far from the first sweep to be numbered, or the map has too many voxels. The map
                stays as it was.
        """
        check_points(sweep, result)
        rows = np.flatnonzero((result.labels >= 0) & is_finite(sweep.points))
        labels = result.labels[rows]
        _check_tracked(result, labels)
        origin = _origin(sweep.pose, self.voxel_m) if self._origin is None else self._origin
        xyz = transformed(sweep.points[rows], from_parts(sweep.pose[:3, :3], sweep.pose[:3, 3] - origin))
        keys = cell_keys(xyz, self.voxel_m)
        numbers = self._objects(result)
        objects = numbers[labels]
        ones = np.ones_like(keys)
        self._take(_merged([_Rows(keys, objects, ones, xyz, result.confidence[rows].astype(np.float64))]))
        self._origin, self._voxels = origin, None
        moving = {numbers[instance.label] for instance in result.instances if any(instance.velocity)}
        self._widen(objects, xyz[:, :2], moving)

    def __len__(self) -> int:
        """Number of voxels."""
        return len(self._known().points)

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3) float64: the mean of the points of each voxel, in metres in the world; voxels are in a fixed order."""
        return self._known().points

    @property
    def categories(self) -> NDArray[np.int32]:
        """(n,) int32: category id of each voxel, 0 for background."""
        return self._known().categories

    @property
    def tracks(self) -> NDArray[np.int32]:
        """(n,) int32: track of each voxel, 0 for background."""
        return self._known().tracks

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(n,) float32 in [0, 1]: confidence of the points with the label of a voxel, summed, over all its points."""
        return self._known().confidence

    def _objects(self, result: Segmentation) -> Ints:
        """The number in this map of each label of a result."""
        known = [(instance.category, instance.track) for instance in result.instances]
        return np.array([0, *(self._numbers.setdefault(each, len(self._numbers)) for each in known)], np.int64)

    def _widen(self, objects: Ints, xy: Floats, moving: Set[int]) -> None:
        for number in np.unique(objects[objects > 0]).tolist():
            low, high = np.percentile(xy[objects == number], [OUTER, 100 - OUTER], axis=0)
            room = self._rooms.setdefault(number, _Room(low, high, high - low))
            room.low, room.high = np.minimum(room.low, low), np.maximum(room.high, high)
            room.longest = np.maximum(room.longest, high - low)
            room.n_sweeps += 1
            room.n_moving += number in moving

    def _take(self, rows: _Rows) -> None:
        """Keep the rows of a sweep for later, or, when there are many, add all that wait for it."""
        self._new.append(rows)
        n_old, n_new = len(self._rows.voxels), sum(len(each.voxels) for each in self._new)
        if n_new > max(ROWS_AT_ONCE, n_old // 4) or n_old + n_new > MOST_ROWS:
            merged = _merged([self._rows, *self._new])
            if len(merged.voxels) > MOST_ROWS:
                self._new.pop()
                raise LimitError(
                    f"map: more than {MOST_ROWS:,} voxels of {self.voxel_m:g} m; take larger ones (voxel_m), or a map "
                    "for each part of the drive"
                )
            self._rows, self._new = merged, []

    def _known(self) -> _Voxels:
        if self._new:
            self._rows, self._new = _merged([self._rows, *self._new]), []
        if self._voxels is None:
            moved = [number for number, room in self._rooms.items() if room.moved]
            stays = ~np.isin(self._rows.objects, moved)
            names = np.array(sorted(self._numbers, key=self._numbers.__getitem__), np.int32)
            origin = np.zeros(3) if self._origin is None else self._origin
            self._voxels = _voted(_Rows._make(column[stays] for column in self._rows), names, origin)
        return self._voxels


def _voted(rows: _Rows, names: NDArray[np.int32], origin: Floats) -> _Voxels:
    """The voxels of rows; `names` has category and track of each object."""
    if not len(rows.voxels):
        return _Voxels(np.zeros((0, 3)), np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0, np.float32))
    # the winner of each voxel comes first
    category, track = names[rows.objects].T
    order = np.lexsort((track, category, -rows.counts, rows.voxels))
    starts = np.flatnonzero(np.diff(rows.voxels, prepend=-1))
    first = order[starts]
    counts = np.add.reduceat(rows.counts, starts)
    return _Voxels(
        points=np.add.reduceat(rows.sums, starts) / counts[:, None] + origin,
        categories=category[first],
        tracks=track[first],
        confidence=(rows.confidence[first] / counts).astype(np.float32),
    )


def _merged(parts: Sequence[_Rows]) -> _Rows:
    """The rows of all parts, those of the same voxel and object added up in their order."""
    all_rows = _Rows(*map(np.concatenate, zip(*parts, strict=True)))
    if not len(all_rows.voxels):
        return all_rows
    order = np.lexsort((all_rows.objects, all_rows.voxels))
    voxels, objects = all_rows.voxels[order], all_rows.objects[order]
    starts = np.flatnonzero((np.diff(voxels, prepend=-1) != 0) | (np.diff(objects, prepend=-1) != 0))
    return _Rows(voxels[starts], objects[starts], *(np.add.reduceat(column[order], starts) for column in all_rows[2:]))


def _origin(pose: Floats, voxel_m: float) -> Floats:
    """Where the grid begins: the corner of a voxel by the first sweep, so that its world may be large."""
    place: Floats = pose[:3, 3]
    coarsest = float(np.spacing(np.abs(place)).max())
    if not coarsest < voxel_m / 100:
        raise LimitError(
            f"pose: coordinates up to {np.abs(place).max():.6g} m are {coarsest:.6g} m apart at best, too coarse for "
            f"voxels of {voxel_m:g} m; put the origin of the world near the drive"
        )
    corner: Floats = np.floor(place / voxel_m) * voxel_m
    return corner


def _check_tracked(result: Segmentation, labels: NDArray[np.int32]) -> None:
    for label in np.unique(labels[labels > 0]).tolist():
        instance = result.instances[label - 1]
        if instance.track == 0:
            raise InputError(
                f"result: instance {label} ({instance.name}) has points and no track; give the results of "
                "ldls.Tracker().track(...), for a map leaves out what moves"
            )
