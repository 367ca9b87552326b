"""The way of a lidar from its sweeps alone, by KISS-ICP.

Source: Vizzo et al., "KISS-ICP: In Defense of Point-to-Point ICP", RA-L 2023, whose Python package does the work. It is
given points that stand alone: lines on the ground go with the lidar, and laid on one another they say that it hardly
moved. What lies low keeps the way level afterwards (`ground_level`).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.camera.rigid import inverse, transformed
from ldls.checks import checked, shown
from ldls.cloud import Points, as_points, finite_rows
from ldls.errors import InputError, LdlsWarning, PoseError, within
from ldls.sequences.grid import cell_keys
from ldls.sequences.ground_level import levelled, split_standing
from ldls.sequences.trajectory import LONGEST_GAP_S, Trajectory, is_gap

BEGINNINGS = 2
"""Times that the first two sweeps are laid on each other again, each time with less of their motion in them."""
PERIOD_S = 0.1
"""Time between sweeps, as long as it is not known: lidars turn ten times a second."""
FARTHEST_M = 100.0
"""Points farther away are too sparse to be found again."""
VOXEL_M = 0.5
POINTS_A_VOXEL = 20
LEAST_POINTS = 100
"""Fewer points do not say how the lidar moved."""
PLACE_M = 1.0
LEAST_SHARE = 0.1
"""Share of the cubes of `PLACE_M` of a sweep, that of fewer cubes, that the next has points in, or the way is lost."""

Parts = tuple[float, Points, NDArray[np.float64] | None]
"""Stamp of a sweep, its points, and when each was measured, where that is known."""
Usable = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Points of a sweep that stand, and those that lie low."""


@checked
def odometry(sweeps: Iterable[tuple[float, Points] | tuple[float, Points, NDArray[np.float64]]]) -> Trajectory:
    """Return the poses of the lidar at sweeps of a drive, found by laying each on those before it.

    The first pose is the identity, so that the world is the lidar's frame at the first sweep. Points with times are
    first moved to the stamp of their sweep, by the motion between the two sweeps before it, those of the first two by
    the motion between these; points without times are all taken to be of that moment. The same sweeps give the same
    poses, on one thread. Errors add up along the way.

    Args:
        sweeps: Stamp in seconds, ascending, and points (N, >= 3) in metres, z up, of each sweep; two or more, and
            neighbours some tenths of a second apart. Third may stand (N,) when each point was measured, in seconds
            after the stamp. They are taken one after the other. Gaps of over a second are warned of.

    Raises:
        PoseError: Stamps do not ascend, a sweep has nothing in common with the one before it, or a time is over a
            second.
        ShapeError: There is not one time a point.
        InputError: There are fewer than two sweeps, or one has too few finite points that stand on the ground.
        ImportError: `ldls[odometry]` is not installed.
    """
    way = Way()
    for number, sweep in enumerate(sweeps):
        parts = _parts(number, sweep)
        with within(f"sweep {number}"):
            way.lay(parts, way.usable(*parts))
    return way.trajectory()


class Way:
    """The way of a lidar, sweep by sweep; errors are those of `odometry`."""

    def __init__(self) -> None:
        """A way without a sweep."""
        self._first: list[Parts] = []
        self._begin(Trajectory(np.array([0, PERIOD_S]), np.array([np.eye(4)] * 2)))

    def _begin(self, motion: Trajectory) -> None:
        """Begin the way anew, without a sweep, with a motion as from the first to the last pose of `motion`."""
        self._before = motion
        self._stamps: list[float] = []
        self._poses: list[NDArray[np.float64]] = []
        self._registration = _registration()
        self._low = np.zeros((0, 3))
        self._places = np.zeros(0, np.int64)

    def __len__(self) -> int:
        """Number of sweeps that are laid."""
        return len(self._stamps)

    def usable(self, stamp: float, points: Points, times: NDArray[np.float64] | None) -> Usable:
        """What of the next sweep says how the lidar moved: where that fails the way stays what it was."""
        points = as_points(points)
        if self._stamps and not stamp > self._stamps[-1]:
            raise PoseError(
                f"its stamp {stamp:.6f} s is not after that before it, {self._stamps[-1]:.6f} s; sort them, and leave "
                "out one of two with the same"
            )
        if times is not None:
            points = self._motion(stamp).deskew(points, times, stamp)
        xyz = points[finite_rows(points), :3].astype(np.float64)
        ranges_m = np.linalg.norm(xyz, axis=1)
        standing, low = split_standing(xyz[(ranges_m > 0) & (ranges_m < FARTHEST_M)])
        if len(standing) < LEAST_POINTS:
            raise InputError(
                f"of {len(points):,} points {len(standing)} are finite, nearer than {FARTHEST_M:g} m and stand, "
                f"expected {LEAST_POINTS} or more; leave this sweep out, or turn points so that z is up"
            )
        return standing, low

    def lay(self, sweep: Parts, usable: Usable) -> None:
        """Take the way to the next sweep, of which so much is usable; no more can be laid after an error."""
        self._lay(sweep[0], usable)
        if len(self) <= 2:
            self._first.append(sweep)
        if len(self) == 2:
            self._begin_again()

    def trajectory(self) -> Trajectory:
        """Return the poses at the sweeps."""
        if len(self) < 2:
            raise InputError(f"sweeps: got {len(self)}, expected 2 or more")
        stamps = np.array(self._stamps)
        _warn_of_gaps(stamps)
        return Trajectory(stamps, np.array(self._poses))

    def _begin_again(self) -> None:
        """Lay the first two sweeps again so that they know each other's motion."""
        first, self._first = self._first, []
        if all(times is None for _, _, times in first):
            return
        for _ in range(BEGINNINGS):
            self._begin(self._motion(0.0))
            for parts in first:
                self._lay(parts[0], self.usable(*parts))

    def _lay(self, stamp: float, usable: Usable) -> None:
        standing, low = usable
        before: NDArray[np.float64] = self._registration.last_pose
        self._registration.register_frame(standing, np.zeros(0))
        pose: NDArray[np.float64] = self._registration.last_pose
        self._check_common(stamp, standing, pose)
        if self._poses:
            # what was corrected in earlier poses goes on, for the library does not know of it
            moved = self._poses[-1] @ inverse(before) @ pose
            pose = levelled(moved, low, self._poses[-1], self._low)
        self._stamps.append(stamp)
        self._poses.append(pose)
        self._low = low

    def _motion(self, stamp: float) -> Trajectory:
        """The way around `stamp`, as it was between the last two sweeps; at rest where these are too far apart."""
        poses, stamps = (self._poses, self._stamps) if len(self) > 1 else (self._before.poses, self._before.stamps)
        back, period_s = inverse(poses[-1]) @ poses[-2], float(stamps[-1] - stamps[-2])
        if is_gap(period_s):
            back, period_s = np.eye(4), PERIOD_S
        return Trajectory(np.array([stamp - period_s, stamp]), np.array([back, np.eye(4)]))

    def _check_common(self, stamp: float, standing: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        places = np.unique(cell_keys(transformed(standing, pose), PLACE_M))
        common = len(np.intersect1d(places, self._places, assume_unique=True))
        if self._stamps and common < LEAST_SHARE * min(len(places), len(self._places)):
            raise PoseError(
                f"the way is lost at {stamp:.6f} s: of {len(places)} places {common} are those of the sweep at "
                f"{self._stamps[-1]:.6f} s; take sweeps of one drive without gaps, or poses of another origin"
            )
        self._places = places


def _warn_of_gaps(stamps: NDArray[np.float64]) -> None:
    """Warn of sweeps after which a lidar that moved is laid where it was: some places look alike."""
    steps_s = np.diff(stamps)
    gaps = [at for at, step_s in enumerate(steps_s.tolist()) if is_gap(step_s)]
    if gaps:
        first = gaps[0]
        warnings.warn(
            f"sweeps: {len(gaps):,} of {len(stamps):,} come over {LONGEST_GAP_S:g} s after the one before, the first "
            f"{steps_s[first]:.3f} s after {stamps[first]:.6f} s, and the way is wrong from there if the lidar moved "
            "meanwhile; mend the stamps if they jump, or take each part by itself",
            LdlsWarning,
            stacklevel=5,
        )


def _registration() -> Any:  # noqa: ANN401
    """KISS-ICP with all of its parameters, of which none is left to the environment, and one thread."""
    settings = require("kiss_icp.config.config", "odometry")
    config = require("kiss_icp.config", "odometry").KISSConfig(
        data=settings.DataConfig(max_range=FARTHEST_M, min_range=0.0, deskew=False),
        mapping=settings.MappingConfig(voxel_size=VOXEL_M, max_points_per_voxel=POINTS_A_VOXEL),
        registration=settings.RegistrationConfig(max_num_iterations=500, convergence_criterion=1e-4, max_num_threads=1),
        adaptive_threshold=settings.AdaptiveThresholdConfig(
            fixed_threshold=None, initial_threshold=2.0, min_motion_th=0.1
        ),
    )
    return require("kiss_icp.kiss_icp", "odometry").KissICP(config)


def _parts(number: int, sweep: object) -> Parts:
    if not (isinstance(sweep, tuple | list) and len(sweep) in (2, 3)):
        raise InputError(
            f"sweeps: sweep {number} is {shown(sweep)}, expected (stamp, points) or (stamp, points, times)"
        )
    try:
        stamp = float(sweep[0])
    except (TypeError, ValueError, OverflowError):
        stamp = float("nan")
    if isinstance(sweep[0], str | bool) or not np.isfinite(stamp):
        raise InputError(f"sweeps: stamp of sweep {number} is {shown(sweep[0])}, expected seconds")
    return stamp, sweep[1], sweep[2] if len(sweep) == 3 else None
