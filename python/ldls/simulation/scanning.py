"""One turn of a lidar in a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.simulation.lidars import Lidar
from ldls.simulation.raycasting import MISS, RayCaster
from ldls.simulation.scenes import Scene
from ldls.simulation.shapes.shape import Material

GLASS_PASSES = 0.9
"""Share of laser pulses that a window lets through."""
MAX_WINDOWS = 6
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sweep:
    """N returns of a lidar, in the order of firing.

    Attributes:
        points: (N, 4) float32 x, y, z in the lidar frame (metres) and intensity in [0, 1].
        instances: (N,) int32 object of each point, 0 for scenery.
        rings: (N,) int32 beam of each point, 0 the highest.
    """

    points: NDArray[np.float32]
    instances: NDArray[np.int32]
    rings: NDArray[np.int32]


def scan(scene: Scene, caster: RayCaster, lidar: Lidar, height_m: float, rng: np.random.Generator) -> Sweep:
    """A sweep of `scene` from `height_m` above its origin."""
    directions = lidar.directions()
    origin = np.array([0.0, 0.0, height_m])
    ranges, faces = _through_windows(scene, caster, origin, directions, rng)
    cosine = np.abs(np.einsum("ij,ij->i", caster.normals[faces], directions))
    reflectance = _reflectance(scene)[faces]
    kept = (faces != MISS) & _returned(lidar, ranges, cosine, reflectance, rng)
    measured = _measured(lidar, ranges[kept], rng)
    intensity = np.clip(reflectance[kept] * (0.35 + 0.65 * cosine[kept]) * rng.normal(1, 0.06, kept.sum()), 0, 1)
    points = np.column_stack([directions[kept] * measured[:, None], np.round(intensity, 2)])
    return Sweep(points.astype(np.float32), scene.face_objects[faces[kept]], lidar.rings()[kept])


def _through_windows(
    scene: Scene, caster: RayCaster, origin: F64, directions: F64, rng: np.random.Generator
) -> tuple[F64, NDArray[np.int64]]:
    """Range and triangle where each pulse ends: most pass a window and go on to what is behind it."""
    ranges, faces = caster.first_hits(origin, directions)
    glass = scene.shape.materials == Material.GLASS
    going = np.flatnonzero((faces != MISS) & glass[faces])
    for _ in range(MAX_WINDOWS):
        going = going[rng.random(len(going)) < GLASS_PASSES]
        if len(going) == 0:
            break
        start = ranges[going] + 1e-3
        onward, faces[going] = caster.first_hits(origin + directions[going] * start[:, None], directions[going])
        ranges[going] = start + onward
        going = going[(faces[going] != MISS) & glass[faces[going]]]
    return ranges, faces


def _reflectance(scene: Scene) -> F64:
    """(F,) share of infrared light that each triangle sends back; leaves and grass are bright there."""
    value: F64 = 0.1 + 0.6 * scene.shape.colours.mean(axis=1).astype(np.float64)
    value[np.isin(scene.shape.materials, (Material.LEAF, Material.GRASS))] += 0.15
    value[scene.shape.materials == Material.REFLECTOR] = 1.0
    value[scene.shape.materials == Material.GLASS] = 0.08
    return value


def _returned(lidar: Lidar, ranges: F64, cosine: F64, reflectance: F64, rng: np.random.Generator) -> NDArray[np.bool_]:
    finite = np.where(np.isfinite(ranges), np.maximum(ranges, 0.1), 1e9)
    signal = lidar.sensitivity * reflectance * cosine * (lidar.max_range_m / finite) ** 2
    chance = (1 - lidar.dropout) * -np.expm1(-signal)
    in_range = (finite >= lidar.min_range_m) & (finite <= lidar.max_range_m)
    seen: NDArray[np.bool_] = in_range & (rng.random(len(finite)) < chance)
    return seen


def _measured(lidar: Lidar, ranges: F64, rng: np.random.Generator) -> F64:
    noisy = ranges + rng.normal(0, 1, len(ranges)) * lidar.range_noise_m
    if lidar.range_step_m == 0:
        return noisy
    stepped: F64 = np.round(noisy / lidar.range_step_m) * lidar.range_step_m
    return stepped
