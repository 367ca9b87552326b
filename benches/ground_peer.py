"""Patchwork++ and our ground: which points each calls ground, how high each says it lies, and how far both err."""

from __future__ import annotations

import argparse
import itertools
import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

import ldls
from benches.frames import Frame
from benches.ground_scenes import LIDARS, SLOPES, GroundScene, ground_scene
from benches.measuring import medians, new_table

WARM_UP = 3
"""Sweeps after which Patchwork++, which adapts its thresholds from sweep to sweep, is asked."""
NEAREST = 10
"""The ground that Patchwork++ gives no height of is as high as the median of so many of its ground points."""
RANGE_M = (2.7, 80.0)
"""Horizontal distances that Patchwork++ looks at by default; other points do not count."""
GROUND_M, ABOVE_M, OBJECT_M = 0.05, 0.2, 0.1
"""True heights up to which a point is of the ground, from which it is not, and from which one of an object counts."""


@dataclass(frozen=True)
class Estimate:
    """What one side says of n points.

    Attributes:
        ground: (n,) bool: called ground.
        ground_m: (n,) z of the ground below the point.
    """

    ground: NDArray[np.bool_]
    ground_m: NDArray[np.float64]

    def of(self, rows: NDArray[np.int64]) -> Estimate:
        """What it says of some of the points."""
        return Estimate(self.ground[rows], self.ground_m[rows])


@dataclass(frozen=True)
class Mistakes:
    """How far an estimate of n points is from the truth.

    Attributes:
        error_m: (n,) of the height of the ground.
        found: Points of the ground that are called so.
        missed: Points of the ground that are not.
        wrong: Points above the ground that are called ground.
        objects: Points of objects, off the ground.
        wrong_objects: Those of them that are called ground.
    """

    error_m: NDArray[np.float64]
    found: int
    missed: int
    wrong: int
    objects: int
    wrong_objects: int

    @classmethod
    def joined(cls, parts: Iterable[Mistakes]) -> Mistakes:
        """The mistakes of several estimates as one."""
        errors, *counts = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(np.concatenate(errors), *(sum(count) for count in counts))

    def row(self) -> list[str]:
        """Errors of height (median, 90 % and 99 %), precision, recall and IoU of the ground, and objects called so."""
        heights = [f"{error:.3f}" for error in np.quantile(self.error_m, [0.5, 0.9, 0.99])]
        shares = (
            self.found / (self.found + self.wrong),
            self.found / (self.found + self.missed),
            self.found / (self.found + self.missed + self.wrong),
            self.wrong_objects / self.objects,
        )
        return heights + [f"{share:.2%}" for share in shares]


class Patchwork:
    """Patchwork++ with its own parameters and the true height of the lidar, on a whole sweep."""

    def __init__(self, scene: GroundScene) -> None:
        import pypatchworkpp

        parameters = pypatchworkpp.Parameters()
        parameters.sensor_height = scene.lidar_height_m
        self._estimator = pypatchworkpp.patchworkpp(parameters)
        # the order that Eigen wants, so that no time goes into turning it
        self._points = np.asfortranarray(scene.points)
        for _ in range(WARM_UP):
            self.run()

    def run(self) -> None:
        """Find the ground."""
        self._estimator.estimateGround(self._points)

    def estimate(self) -> Estimate:
        """What the last run found."""
        from scipy.spatial import cKDTree

        ground = np.zeros(len(self._points), bool)
        ground[self._estimator.getGroundIndices()] = True
        xyz = self._points[:, :3].astype(np.float64)
        _, nearest = cKDTree(xyz[ground, :2]).query(xyz[:, :2], k=NEAREST)
        return Estimate(ground, np.median(xyz[ground, 2][nearest], axis=1))


def our_ground(points: NDArray[np.float32], camera: ldls.Camera) -> Estimate:
    """What `stages.ground` says of points, on one thread."""
    heights = ldls.stages.ground(points, camera, threads=1)
    return Estimate(ldls.stages.on_ground(heights), points[:, 2] - heights)


def mistakes(scene: GroundScene, rows: NDArray[np.int64], said: Estimate) -> Mistakes:
    """The mistakes in what is said of some points of a scene."""
    points, ground_m, objects = scene.points[rows], scene.ground_m[rows], scene.objects[rows]
    up, distance = points[:, 2] - ground_m, np.hypot(points[:, 0], points[:, 1])
    counted = np.isfinite(ground_m) & (distance > RANGE_M[0]) & (distance < RANGE_M[1])
    level = counted & ~objects & (np.abs(up) < GROUND_M)
    standing = counted & objects & (up > OBJECT_M)
    return Mistakes(
        error_m=np.abs(said.ground_m - ground_m)[counted],
        found=int((level & said.ground).sum()),
        missed=int((level & ~said.ground).sum()),
        wrong=int((counted & (up > ABOVE_M) & said.ground).sum()),
        objects=int(standing.sum()),
        wrong_objects=int((standing & said.ground).sum()),
    )


def ground(_measured: Frame, options: argparse.Namespace) -> Table:
    """The ground of simulated scenes against Patchwork++: heights, labels and time."""
    seeds = range(4)
    names = ("Patchwork++", "ldls, sweep", "Patchwork++ in view", "ldls in view")
    table = new_table(
        f"ground of {2 * len(seeds)} simulated scenes a row",
        ["slopes, lidar", "side", "p50, m", "p90", "p99", "precision", "recall", "IoU", "objects", "ms"],
        "errors of height; objects: points of objects called ground; Patchwork++ is given whole sweeps; one thread",
    )
    for slopes, lidar in itertools.product(SLOPES, LIDARS):
        found: dict[str, list[Mistakes]] = {name: [] for name in names}
        seconds: dict[str, list[float]] = {name: [] for name in names}
        for seed, kind in itertools.product(seeds, ("street", "campus")):
            scene = ground_scene(seed, kind, slopes, lidar)
            whole, rows = np.arange(len(scene.points)), scene.in_view
            in_view, peer = scene.points[rows], Patchwork(scene)
            sides: dict[str, Callable[[], object]] = {
                names[0]: peer.run,
                names[1]: partial(our_ground, scene.points, scene.camera),
                names[3]: partial(our_ground, in_view, scene.camera),
            }
            for name, median in medians(sides, runs=min(options.runs, 7)).items():
                seconds[name].append(median)
            said = peer.estimate()
            for name, points, estimate in (
                (names[0], whole, said),
                (names[1], whole, our_ground(scene.points, scene.camera)),
                (names[2], rows, said.of(rows)),
                (names[3], rows, our_ground(in_view, scene.camera)),
            ):
                found[name].append(mistakes(scene, points, estimate))
        for name in names:
            ms = f"{statistics.median(seconds[name]) * 1e3:.1f}" if seconds[name] else ""
            table.add_row(f"{slopes}, {lidar}", name, *Mistakes.joined(found[name]).row(), ms)
        table.add_section()
    return table
