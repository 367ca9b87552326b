"""Poses that keep to the ground: height, roll and pitch by what lies low in two sweeps.

Lines of a lidar go with it, up and down too, so that sweeps laid on one another by their nearest points take a slope
for a level, and a lidar of 16 lines seems to turn by a degree a second. Heights of the ground know no lines.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.camera.rigid import from_parts, from_quaternion, transformed
from ldls.cloud import Floats
from ldls.sequences.grid import cell_keys

CELL_M = 1.0
STANDING_M = 0.3
"""Higher above the lowest point of their cell, points stand."""
NEAR_M = 20.0
"""Farther away, lines on the ground are too far apart for its height."""
LEAST_CELLS = 30
"""Fewer cells in common say nothing about the ground."""
NOISE_M = 0.03
ROUNDS = 8
LARGEST_M, LARGEST_DEG = 0.2, 2.0
"""No error of a pose from one sweep to the next is as large; such ground is another."""


def split_standing(xyz: Floats) -> tuple[Floats, Floats]:
    """Points that stand, and those near by that lie low: the lowest `STANDING_M` of each upright column.

    Args:
        xyz: (n, 3) finite, in metres, with z up.
    """
    _, cells = np.unique(cell_keys(xyz[:, :2], CELL_M), return_inverse=True)
    lowest = np.full(int(cells.max(initial=-1)) + 1, np.inf)
    np.minimum.at(lowest, cells, xyz[:, 2])
    stands = xyz[:, 2] > lowest[cells] + STANDING_M
    return xyz[stands], xyz[~stands & (np.hypot(xyz[:, 0], xyz[:, 1]) < NEAR_M)]


def levelled(
    pose: NDArray[np.float64], low: Floats, pose_before: NDArray[np.float64], low_before: Floats
) -> NDArray[np.float64]:
    """`pose`, raised, rolled and pitched so that what lies low in its sweep lies as high as in the sweep before.

    It stays as it is where the two sweeps have too little ground in common.
    """
    keys_before, means_before = _cell_means(low_before, pose_before)
    moved = pose
    for _ in range(2):  # the cells change a little with the pose
        keys, means = _cell_means(low, moved)
        _, own, others = np.intersect1d(keys, keys_before, assume_unique=True, return_indices=True)
        if len(own) < LEAST_CELLS:
            return pose
        step = means[own] - means_before[others]
        # the means of a cell lie apart, and ground slopes in the world of a lidar that is mounted with roll or pitch
        _, *slopes = _plane(means_before[others, :2] - moved[:2, 3], means_before[others, 2])
        above, by_x, by_y = _plane(means[own, :2] - moved[:2, 3], step[:, 2] - step[:, :2] @ slopes)
        half = np.array([-by_y, by_x]) / 2
        turn = from_quaternion("turn", np.array([1.0, *half, 0.0]) / np.sqrt(1 + half @ half))
        moved = from_parts(turn @ moved[:3, :3], moved[:3, 3] - [0, 0, above])
    by_deg = np.degrees(np.arccos(np.clip((np.trace(pose[:3, :3].T @ moved[:3, :3]) - 1) / 2, -1, 1)))
    small = abs(moved[2, 3] - pose[2, 3]) <= LARGEST_M and by_deg <= LARGEST_DEG
    return moved if small else pose


def _cell_means(low: Floats, pose: NDArray[np.float64]) -> tuple[NDArray[np.int64], Floats]:
    """The cells of the world in which points lie, ascending, and the mean of those in each."""
    world = transformed(low, pose)
    keys, cells, counts = np.unique(cell_keys(world[:, :2], CELL_M), return_inverse=True, return_counts=True)
    return keys, np.stack([np.bincount(cells, axis) / counts for axis in world.T], axis=1)


def _plane(xy: Floats, z: NDArray[np.float64]) -> tuple[float, float, float]:
    """Height at the origin, and slopes along x and y, of the plane that most points lie on."""
    columns = np.column_stack([np.ones(len(xy)), xy])
    weights = np.ones(len(xy))
    for _ in range(ROUNDS):
        solution = np.linalg.lstsq(columns * weights[:, None], z * weights, rcond=None)[0]
        weights = 1 / (1 + ((z - columns @ solution) / NOISE_M) ** 2)
    above, by_x, by_y = solution.tolist()
    return above, by_x, by_y
