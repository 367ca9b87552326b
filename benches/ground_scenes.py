"""Sweeps of simulated scenes with the true ground below every point, on usual slopes and on steep ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import ldls
from ldls.simulation.ground import Ground
from ldls.simulation.plan import Plan
from ldls.simulation.raycasting import RayCaster
from ldls.simulation.rigs import make_rig
from ldls.simulation.scanning import scan
from ldls.simulation.scenes import build, make_plan

LIDARS = ("hdl-64e", "hdl-32e", "vlp-16", "os1-128")
SLOPES = ("usual", "steep")
STEEP, STEEP_ROLL_M, HIGH_KERB_M = 0.08, 0.5, 0.2
ABOVE_ALL_M = 100.0


@dataclass(frozen=True)
class GroundScene:
    """N points of one sweep and what is true of them.

    Attributes:
        points: (N, 4) float32 x, y, z in metres and intensity.
        camera: The camera that looks ahead.
        in_view: (n,) rows of the points that it sees.
        lidar_height_m: Of the lidar above the ground below it.
        ground_m: (N,) z of the ground below each point; NaN beyond the scene.
        objects: (N,) bool: whether the point is of an object.
    """

    points: NDArray[np.float32]
    camera: ldls.Camera
    in_view: NDArray[np.int64]
    lidar_height_m: float
    ground_m: NDArray[np.float64]
    objects: NDArray[np.bool_]


def ground_scene(seed: int, kind: str, slopes: str, lidar: str) -> GroundScene:
    """The scene of a seed and a kind, `street` or `campus`, with its `usual` slopes or with `steep` ones."""
    plan, rig = make_plan(seed, kind=kind), make_rig(lidar=lidar)
    if slopes == "steep":
        _stand_on(plan, _steep(plan.ground, np.random.default_rng(seed)))
    scene = build(plan)
    sweep = scan(scene, RayCaster(scene.shape), rig.lidar, rig.height_m, np.random.default_rng(seed))
    camera = rig.cameras[0].calibration()
    assert camera.image_size is not None
    in_view, _ = ldls.stages.project(sweep.points, camera, image_size=camera.image_size)
    ground_m = _surface_below(plan.ground, sweep.points) - rig.height_m
    return GroundScene(sweep.points, camera, in_view, rig.height_m, ground_m, sweep.instances > 0)


def _steep(ground: Ground, rng: np.random.Generator) -> Ground:
    """The ground with slopes of up to `STEEP` either way, long waves and high kerbs."""
    strips = tuple(replace(strip, up_m=HIGH_KERB_M if strip.up_m else 0.0) for strip in ground.strips)
    along, across = rng.uniform(-STEEP, STEEP, 2)
    return replace(ground, strips=strips, slope=(float(along), float(across)), roll_m=STEEP_ROLL_M)


def _stand_on(plan: Plan, ground: Ground) -> None:
    """Lay another ground under everything: what stands on it follows its slope."""
    placed = [(0, 0, ground.shape())]
    for number, look, shape in plan.placed[1:]:
        x, y, z = shape.vertices_m.T
        higher = ground.height_m(x, y) - plan.ground.height_m(x, y)
        placed.append((number, look, replace(shape, vertices_m=np.column_stack([x, y, z + higher]))))
    plan.placed, plan.ground = placed, ground


def _surface_below(ground: Ground, points: NDArray[np.float32]) -> NDArray[np.float64]:
    """(N,) z of the triangles of the ground below points, in metres; NaN where there is none."""
    above = np.column_stack([points[:, :2], np.full(len(points), ABOVE_ALL_M)]).astype(np.float64)
    down = np.broadcast_to([0.0, 0.0, -1.0], above.shape)
    ranges, _ = RayCaster(ground.shape()).first_hits(above, down)
    return np.where(np.isfinite(ranges), ABOVE_ALL_M - ranges, np.nan)
