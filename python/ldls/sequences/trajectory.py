"""Where the lidar was, over time."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.by_value import ByValue
from ldls.camera.rigid import from_parts, from_quaternion, inverse, rigid, to_quaternion, transformed
from ldls.checks import as_array, checked, numbers
from ldls.checks.values import as_seconds
from ldls.cloud import Floats, Points, as_points
from ldls.doubts import doubt_of_precision
from ldls.errors import PoseError, PrecisionWarning, ShapeError

LONGEST_GAP_S = 1.0
"""Between poses farther apart in time, nothing is interpolated."""
SAME_S = 1e-5
"""Times that differ by less are equal: files round stamps to microseconds, and stamps since 1970 to 0.24 of one."""
JUMP_M_S = 100.0
"""Poses that need more than this speed jump."""
TURN_S = 0.1
"""Time in which a lidar turns once; so much farther out than `at`, and a period at least, a motion goes on."""
BLOCK = 16384
"""Points that are moved at once: so many and what is made of them stay in the cache."""
LONGEST_S = 1.0
"""Farther from the stamp of its sweep no point is measured and no image taken: the unit or the clock is another."""


@checked
@dataclass(frozen=True, eq=False)
class Trajectory(ByValue):
    """The poses of a lidar over time.

    Attributes:
        stamps: (n,) float64 seconds, strictly ascending, of the clock of the sweeps; since 1970 they resolve 0.24
            microseconds.
        poses: (n, 4, 4) float64 `T_world_lidar` at each stamp: rigid transforms from lidar coordinates, in metres, to
            those of a frame that stays where it is, and whose z is up for tracks and maps. Translations lose digits far
            from its origin: those in single precision come with a `PrecisionWarning` where these are centimetres.

    Raises:
        PoseError: There is no pose, stamps are not in seconds or do not ascend, a pose is no rigid transform, or two
            neighbours are farther from each other than 100 m/s allow; the message has the stamps.
        ShapeError: An array of another shape.
        DtypeError: Something else than numbers.
    """

    stamps: NDArray[np.float64]
    poses: NDArray[np.float64]

    def __post_init__(self) -> None:
        # copies, which nobody else changes
        stamps = numbers("stamps", self.stamps, np.float64, ("n",)).copy()
        poses = numbers("poses", self.poses, np.float64, ("n", 4, 4)).copy()
        if len(stamps) != len(poses):
            raise PoseError(f"stamps: there are {len(stamps)} for {len(poses)} poses, expected one a pose")
        if not len(stamps):
            raise PoseError("poses: got none, expected at least one")
        _check_stamps(stamps)
        _check_rigid(stamps, poses)
        _check_speeds(stamps, poses)
        warn_of_rounded("poses", self.poses, poses[:, :3, 3])
        for name, values in (("stamps", stamps), ("poses", poses)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        """Number of poses."""
        return len(self.stamps)

    @property
    def margin_s(self) -> float:
        """Time before the first pose and after the last one for which `at` answers: half of the median period."""
        return float(np.median(np.diff(self.stamps))) / 2 if len(self) > 1 else 0.0

    @checked
    def at(self, stamp: float) -> NDArray[np.float64]:
        """(4, 4) `T_world_lidar` at a moment; a pose as it stands at its own stamp.

        Between two poses the translation changes evenly, and the rotation evenly by the shortest turn from one to the
        other. Up to `margin_s` beyond either end the motion goes on as between the two poses there.

        Args:
            stamp: The moment, in seconds, of the clock of `stamps`.

        Raises:
            PoseError: It lies farther out, or between two poses that are more than `LONGEST_GAP_S` apart.
        """
        return self._at(stamp, self.margin_s)

    @checked
    def motion(self, start: float, end: float) -> NDArray[np.float64]:
        """(4, 4) from coordinates of the lidar at one moment to its coordinates at another.

        Of the moments one may lie farther out than `at` answers, by a period, and by 0.1 s where periods are shorter.

        Args:
            start: The one moment, in seconds, of the clock of `stamps`.
            end: The other, at most a second away.

        Raises:
            PoseError: They are farther from each other, lie farther out, or in a gap of the poses.
        """
        if not abs(start - end) <= LONGEST_S + SAME_S:
            raise PoseError(
                f"start: {start - end:+.6g} s from the other moment, expected at most {LONGEST_S:g} s; give seconds of "
                "the same clock"
            )
        return inverse(self._at(end, self._reach_s)) @ self._at(start, self._reach_s)

    @checked
    def deskew(self, points: Points, times: NDArray[np.float64], stamp: float) -> Points:
        """Return the points of a sweep as if all had been measured at one moment, from where the lidar then was.

        Each is moved by `motion`, to whose reach at the ends of the drive the same goes. Missing returns (0, 0, 0) and
        points that are not finite stay what they are, whatever their time.

        Args:
            points: (N, >= 3) x y z first, in metres, each in the lidar frame at its own time.
            times: (N,) when each was measured, in seconds after `stamp`; negative before it.
            stamp: The moment, in seconds, of the clock of `stamps`.

        Returns:
            A new array of the same type; columns beyond the third are those of `points`.

        Raises:
            ShapeError: There is not one time a point.
            DtypeError: Points are no real numbers, or times no numbers.
            PoseError: A time is not finite or over a second, or poses do not say how the lidar moved then.
        """
        points = as_points(points)
        times = numbers("times", times, np.float64, ("N",))
        if len(times) != len(points):
            raise ShapeError(f"times: there are {len(times)} for {len(points)} points, expected one a point")
        rows = _there(points)
        rows = rows[times[rows] != 0]
        own = times[rows]
        _check_times(own)
        moved = points.copy()
        if not len(rows):
            return moved
        for end in (own.min(), own.max()):
            self._check_reach(stamp + float(end), self._reach_s)
        if len(self) == 1:  # and times too short to be any after its stamp
            return moved
        steps = self._steps(own, stamp)
        for first in range(0, len(rows), BLOCK):
            some, after = rows[first : first + BLOCK], own[first : first + BLOCK]
            starts = self._starts(after, stamp)
            for start, step in steps.items():
                part = np.flatnonzero(starts == start)
                shares = (after[part] - (self.stamps[start] - stamp)) / (self.stamps[start + 1] - self.stamps[start])
                with np.errstate(over="ignore", invalid="ignore"):  # of coordinates that are none
                    moved[some[part], :3] = step.moved(points[some[part], :3].astype(np.float64), shares)
        return moved

    def _steps(self, times: NDArray[np.float64], stamp: float) -> dict[int, _Step]:
        """The steps in which there are times after `stamp`, as seen from where the lidar was then."""
        here = inverse(self._at(stamp, self._reach_s))
        starts = np.flatnonzero(np.bincount(self._starts(times, stamp))).tolist()
        for start in starts:
            self._check_gap(start, stamp)
        return {start: _Step.between(here @ self.poses[start], here @ self.poses[start + 1]) for start in starts}

    def _starts(self, times: NDArray[np.float64], stamp: float) -> NDArray[np.intp]:
        """Number of the pose with which the step of each time after `stamp` starts."""
        # after the stamp, for sums since 1970 have few digits left
        return np.clip(np.searchsorted(self.stamps - stamp, times, side="right") - 1, 0, len(self) - 2)

    @property
    def _reach_s(self) -> float:
        """Time beyond either end up to which motion goes on."""
        return self.margin_s + max(2 * self.margin_s, TURN_S) if len(self) > 1 else 0.0

    def _at(self, stamp: float, reach_s: float) -> NDArray[np.float64]:
        """The pose at a moment up to `reach_s` beyond either end."""
        after = int(np.searchsorted(self.stamps, stamp))
        if after < len(self) and self.stamps[after] == stamp:
            return np.array(self.poses[after])
        self._check_reach(stamp, reach_s)
        start = min(max(after - 1, 0), len(self) - 2)
        self._check_gap(start, stamp)
        begin, end = float(self.stamps[start]), float(self.stamps[start + 1])
        return _Step.between(self.poses[start], self.poses[start + 1]).at((stamp - begin) / (end - begin))

    def _check_reach(self, stamp: float, reach_s: float) -> None:
        first, last = float(self.stamps[0]), float(self.stamps[-1])
        if not first - reach_s <= stamp <= last + reach_s:
            raise PoseError(
                f"stamp: no pose at {stamp:.6f} s, poses are from {first:.6f} to {last:.6f} s; take poses of the whole "
                "drive and of the same clock, or leave this moment out"
            )

    def _check_gap(self, start: int, stamp: float) -> None:
        begin, end = float(self.stamps[start]), float(self.stamps[start + 1])
        if is_gap(end - begin):
            raise PoseError(
                f"stamp: no pose at {stamp:.6f} s, for poses have a gap of {end - begin:.3f} s from {begin:.6f} to "
                f"{end:.6f} s, expected at most {LONGEST_GAP_S} s; add poses there, or leave this moment out"
            )


def warn_of_rounded(name: str, given: ArrayLike, places: Floats) -> None:
    """Warn of poses that were given in single precision, where that is too coarse for their places, in metres."""
    if as_array(name, given).dtype != np.float32:
        return
    doubt = doubt_of_precision(name, float(np.abs(places).max()))
    if doubt is not None:
        warnings.warn(doubt, PrecisionWarning, stacklevel=5)


@dataclass(frozen=True, eq=False)
class _Step:
    """The motion from one pose to another: even along a line, and by the shortest turn.

    Attributes:
        pose: (4, 4) the one.
        shift: (3,) from its place to that of the other, in metres.
        axis: (3,) of the turn, in coordinates of the one; zeros for none.
        half_turn: Half of the angle, in radians.
    """

    pose: Floats
    shift: Floats
    axis: Floats
    half_turn: float

    @classmethod
    def between(cls, one: Floats, other: Floats) -> _Step:
        """The motion from the pose `one` to the pose `other`, both (4, 4)."""
        w, *vector = to_quaternion(one[:3, :3].T @ other[:3, :3]).tolist()
        sine = float(np.linalg.norm(vector))
        axis = np.array(vector) / sine if sine > 0 else np.zeros(3)
        return cls(one, other[:3, 3] - one[:3, 3], axis, float(np.arctan2(sine, w)))

    def at(self, share: float) -> Floats:
        """The pose at this share of the way; below 0 and above 1 the motion goes on."""
        half_turn = share * self.half_turn
        turn = from_quaternion("turn", np.array([np.cos(half_turn), *(np.sin(half_turn) * self.axis)]))
        return from_parts(self.pose[:3, :3] @ turn, self.pose[:3, 3] + share * self.shift)

    def moved(self, xyz: Floats, shares: Floats) -> Floats:
        """(n, 3) points, each moved by the pose at its own share of the way.

        It is `at` for many, with the turn by Rodrigues' formula: 1 + sin(a) K + (1 - cos(a)) K K, K x = axis cross x.
        """
        angles = 2 * self.half_turn * shares[:, None]
        x, y, z = self.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = self.pose[:3, :3]
        moved = transformed(xyz, self.pose) + shares[:, None] * self.shift
        moved += np.sin(angles) * transformed(xyz, from_parts(turn @ cross))
        moved += (1 - np.cos(angles)) * transformed(xyz, from_parts(turn @ cross @ cross))
        return moved


def is_gap(step_s: float) -> bool:
    """True where poses or sweeps so many seconds apart are too far from each other to be joined."""
    return not step_s <= LONGEST_GAP_S + SAME_S


def _there(points: Points) -> NDArray[np.int64]:
    """Rows of points that are finite and no missing returns, ascending."""
    x, y, z = points[:, :3].T
    return np.flatnonzero(np.isfinite(x) & np.isfinite(y) & np.isfinite(z) & ((x != 0) | (y != 0) | (z != 0)))


def _check_times(times: NDArray[np.float64]) -> None:
    """Of points that are there."""
    near = np.abs(times) <= LONGEST_S + SAME_S
    if not near.all():
        at = int(np.argmin(near))
        raise PoseError(
            f"times: a point has {times[at]:.6g} s, expected at most {LONGEST_S:g} s from the stamp of its sweep; give "
            "seconds after that stamp"
        )


def _check_stamps(stamps: NDArray[np.float64]) -> None:
    farthest = int(np.argmax(np.abs(stamps)))  # NaN, if there is one
    as_seconds(f"stamps: pose {farthest}", float(stamps[farthest]), PoseError)
    ascending = np.diff(stamps) > 0
    if not ascending.all():
        at = int(np.argmin(ascending))
        raise PoseError(
            f"stamps: pose {at} has {stamps[at]:.6f} s and pose {at + 1} {stamps[at + 1]:.6f} s, expected ascending "
            "ones; sort them and leave out what stands there twice"
        )


def _check_rigid(stamps: NDArray[np.float64], poses: NDArray[np.float64]) -> None:
    for at, pose in enumerate(poses):
        place = f"poses: pose {at} at {stamps[at]:.6f} s"
        if not np.isfinite(pose).all():
            raise PoseError(f"{place} is not finite; leave it out")
        rigid(place, pose, PoseError)


def _check_speeds(stamps: NDArray[np.float64], poses: NDArray[np.float64]) -> None:
    with np.errstate(over="ignore"):  # of coordinates that are none
        metres = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    seconds = np.diff(stamps)
    slow = metres <= JUMP_M_S * seconds
    if not slow.all():
        at = int(np.argmin(slow))
        raise PoseError(
            f"poses: from {stamps[at]:.6f} to {stamps[at + 1]:.6f} s the lidar moves {metres[at]:.6g} m in "
            f"{seconds[at]:.6g} s, expected at most {JUMP_M_S:g} m/s; leave out the pose that jumps, and give "
            "metres and seconds"
        )
