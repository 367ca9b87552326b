"""K nearest neighbours of every point, by the libraries one would otherwise use."""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

import ldls
from benches.frames import Frame, tiled_points
from benches.measuring import medians, new_table

K = 10


def searches(points: NDArray[np.float32], threads: int) -> dict[str, Callable[[], object]]:
    """A search for each library: build the tree of (n, 3) points, and find the 10 nearest of each, itself aside."""
    import small_gicp
    from pykdtree.kdtree import KDTree
    from scipy.spatial import cKDTree

    doubles = points.astype(np.float64)

    def gicp() -> object:
        cloud = small_gicp.PointCloud(doubles)
        return small_gicp.KdTree(cloud, num_threads=threads).batch_knn_search(doubles, K + 1, num_threads=threads)

    return {
        "ldls": lambda: ldls._ldls.neighbors(doubles, K, threads),
        "pykdtree": lambda: KDTree(points).query(points, k=K + 1),
        "scipy": lambda: cKDTree(points).query(points, K + 1, workers=threads),
        "small_gicp": gicp,
    }


def clouds(sweep: NDArray[np.float32], in_view: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
    """The sizes and shapes that trees find easy and hard."""
    side = np.arange(50, dtype=np.float32)
    return {
        "in view": in_view,
        "sweep": sweep,
        "8 sweeps": tiled_points(sweep, 8 * len(sweep)),
        "sweep in cm": np.round(sweep, 2),
        "sweep, flat": sweep * np.float32([1, 1, 0]),
        "sweep, every point twice": np.repeat(sweep[: len(sweep) // 2], 2, axis=0),
        "sweep, every point twenty times": np.repeat(sweep[: len(sweep) // 20], 20, axis=0),
        "lattice of 50 x 50 x 50": np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3),
    }


def neighbors(measured: Frame, options: argparse.Namespace) -> Table:
    """Nearest neighbours against pykdtree, SciPy and small_gicp."""
    table = new_table(
        "10 nearest neighbours of every point, tree included, ms",
        ["cloud", "points", "ldls", "pykdtree", "scipy", "small_gicp", "pykdtree / ldls"],
        f"medians, {options.threads} threads on all sides",
    )
    sweep = np.ascontiguousarray(measured.points[:, :3])
    for name, cloud in clouds(sweep, measured.in_view()).items():
        rounds = options.runs if len(cloud) < 500_000 else min(options.runs, 5)
        found = medians(searches(cloud, options.threads), runs=rounds)
        times = [f"{found[peer] * 1e3:.1f}" for peer in ("ldls", "pykdtree", "scipy", "small_gicp")]
        table.add_row(name, f"{len(cloud):,}", *times, f"{found['pykdtree'] / found['ldls']:.2f} x")
    return table
