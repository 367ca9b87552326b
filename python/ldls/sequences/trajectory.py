"""Where the lidar was, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.camera.rigid import from_parts, from_quaternion, rigid, to_quaternion
from ldls.checks import checked, numbers
from ldls.errors import PoseError

LONGEST_GAP_S = 1.0
"""Between poses farther apart in time, nothing is interpolated."""
FASTEST_M_S = 100.0
"""Poses that need more than this speed jump."""


@checked
@dataclass(frozen=True, eq=False)
class Trajectory:
    """The poses of a lidar over time.

    Attributes:
        stamps: (n,) float64 seconds, strictly ascending, of the clock of the sweeps; since 1970 they resolve 0.24
            microseconds.
        poses: (n, 4, 4) float64 `T_world_lidar` at each stamp: rigid transforms from lidar coordinates, in metres, to
            those of a frame that stays where it is. Translations lose digits far from its origin.

    Raises:
        PoseError: There is no pose, stamps do not ascend, a pose is no rigid transform, or two neighbours are farther
            from each other than 100 m/s allow; the message has the stamps.
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
        after = int(np.searchsorted(self.stamps, stamp))
        if after < len(self) and self.stamps[after] == stamp:
            return np.array(self.poses[after])
        first, last, margin_s = float(self.stamps[0]), float(self.stamps[-1]), self.margin_s
        if not first - margin_s <= stamp <= last + margin_s:
            raise PoseError(
                f"stamp: no pose at {stamp:.6f} s, poses are from {first:.6f} to {last:.6f} s; take poses of the whole "
                "drive and of the same clock, or leave this moment out"
            )
        start = min(max(after - 1, 0), len(self) - 2)
        begin, end = float(self.stamps[start]), float(self.stamps[start + 1])
        if end - begin > LONGEST_GAP_S:
            raise PoseError(
                f"stamp: no pose at {stamp:.6f} s, for poses have a gap of {end - begin:.3f} s from {begin:.6f} to "
                f"{end:.6f} s, expected at most {LONGEST_GAP_S} s; add poses there, or leave this moment out"
            )
        return _between(self.poses[start], self.poses[start + 1], (stamp - begin) / (end - begin))


def _between(one: NDArray[np.float64], other: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """The pose at this share of the way from one to the other."""
    w, *vector = to_quaternion(one[:3, :3].T @ other[:3, :3]).tolist()
    sine = float(np.linalg.norm(vector))
    half_turn = share * np.arctan2(sine, w)
    axis = np.array(vector) / sine if sine > 0 else np.zeros(3)
    turn = from_quaternion("turn", np.array([np.cos(half_turn), *(np.sin(half_turn) * axis)]))
    return from_parts(one[:3, :3] @ turn, one[:3, 3] + share * (other[:3, 3] - one[:3, 3]))


def _check_stamps(stamps: NDArray[np.float64]) -> None:
    finite = np.isfinite(stamps)
    if not finite.all():
        at = int(np.argmin(finite))
        raise PoseError(f"stamps: pose {at} has {stamps[at]}, expected seconds; leave it out")
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
    slow = metres <= FASTEST_M_S * seconds
    if not slow.all():
        at = int(np.argmin(slow))
        raise PoseError(
            f"poses: from {stamps[at]:.6f} to {stamps[at + 1]:.6f} s the lidar moves {metres[at]:.6g} m in "
            f"{seconds[at]:.6g} s, expected at most {FASTEST_M_S:g} m/s; leave out the pose that jumps, and give "
            "metres and seconds"
        )
