"""One turn of a lidar in a scene: at one instant, or while all moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Floats, Ints
from ldls.simulation.lidars import Lidar
from ldls.simulation.moving_caster import MovingCaster
from ldls.simulation.raycasting import MISS, RayCaster
from ldls.simulation.scenes import Scene
from ldls.simulation.shapes.shape import Material

GLASS_PASSES = 0.9
"""Share of laser pulses that a window lets through."""
MAX_WINDOWS = 6
Cast = Callable[[Ints, Floats], tuple[Floats, Ints]]
"""Range and triangle that pulses (r,) meet next, each after so many metres (r,) of its way; ranges count from there."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """N returns of a lidar, in the order of firing.

    Attributes:
        points: (N, 4) float32 x, y, z in the lidar frame (metres) and intensity in [0, 1].
        instances: (N,) int32 object of each point, 0 for scenery.
        rings: (N,) int32 beam of each point, 0 the highest.
        times: (N,) seconds since the stamp of the sweep, negative before it; None if all are of one instant.
    """

    points: NDArray[np.float32]
    instances: NDArray[np.int32]
    rings: NDArray[np.int32]
    times: Floats | None = None


@dataclass(frozen=True, eq=False)
class Motion:
    """Where a rig and M objects are at each of the n firings of a turn, as seen from the rig at the stamp of the sweep.

    Attributes:
        times: (n,) seconds since the stamp, negative before it.
        rig: (n, 4, 4) transform from the ground below the rig at each firing to that below it at the stamp.
        ways_m: (M, n, 3) way of each object since the stamp, in metres.
    """

    times: Floats
    rig: Floats
    ways_m: Floats


def scan(scene: Scene, caster: RayCaster, lidar: Lidar, height_m: float, rng: np.random.Generator) -> Sweep:
    """A sweep of `scene` from `height_m` above its origin, at one instant."""
    directions = lidar.directions()
    origin = np.array([0.0, 0.0, height_m])

    def cast(pulses: Ints, after_m: Floats) -> tuple[Floats, Ints]:
        return caster.first_hits(origin + directions[pulses] * after_m[:, None], directions[pulses])

    ranges, faces = _through_windows(scene, cast, len(directions), rng)
    cosine = np.abs(np.einsum("ij,ij->i", caster.normals[faces], directions))
    return _measured(scene, lidar, directions, None, ranges, faces, cosine, rng)


def scan_moving(scene: Scene, lidar: Lidar, height_m: float, motion: Motion, rng: np.random.Generator) -> Sweep:
    """A sweep that takes the time of its turn.

    Each point has the coordinates of the lidar at the time of its pulse.

    Args:
        scene: The scene at the stamp, as seen from the ground below the rig.
        lidar: The lidar.
        height_m: Its height above the ground, in metres.
        motion: Where rig and objects are at each of the lidar's firings.
        rng: Numbers of the noise.
    """
    directions = lidar.directions()
    firings = np.repeat(np.arange(lidar.firings), len(lidar.elevations_deg))
    by_firing = directions.reshape(lidar.firings, -1, 3)
    towards = (by_firing @ motion.rig[:, :3, :3].transpose(0, 2, 1)).reshape(-1, 3)
    origins = (motion.rig @ [0.0, 0.0, height_m, 1.0])[:, :3]
    caster = MovingCaster(scene, motion.ways_m)

    def cast(pulses: Ints, after_m: Floats) -> tuple[Floats, Ints]:
        begin = origins[firings[pulses]] + towards[pulses] * after_m[:, None]
        return caster.first_hits(begin, towards[pulses], firings[pulses])

    ranges, faces = _through_windows(scene, cast, len(directions), rng)
    cosine = np.abs(np.einsum("ij,ij->i", caster.normals[faces], towards))
    return _measured(scene, lidar, directions, motion.times[firings], ranges, faces, cosine, rng)


def _through_windows(scene: Scene, cast: Cast, count: int, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Range and triangle where each of `count` pulses ends: most pass a window and go on to what is behind it."""
    ranges, faces = cast(np.arange(count), np.zeros(count))
    glass = scene.shape.materials == Material.GLASS
    going = np.flatnonzero((faces != MISS) & glass[faces])
    for _ in range(MAX_WINDOWS):
        going = going[rng.random(len(going)) < GLASS_PASSES]
        if len(going) == 0:
            break
        start = ranges[going] + 1e-3
        onward, faces[going] = cast(going, start)
        ranges[going] = start + onward
        going = going[(faces[going] != MISS) & glass[faces[going]]]
    return ranges, faces


def _measured(
    scene: Scene,
    lidar: Lidar,
    directions: Floats,
    times: Floats | None,
    ranges: Floats,
    faces: Ints,
    cosine: Floats,
    rng: np.random.Generator,
) -> Sweep:
    """What a lidar reports of the triangles that its pulses meet, each at an angle of such a cosine."""
    reflectance = _reflectance(scene)[faces]
    kept = (faces != MISS) & _returned(lidar, ranges, cosine, reflectance, rng)
    measured = _noisy(lidar, ranges[kept], rng)
    intensity = np.clip(reflectance[kept] * (0.35 + 0.65 * cosine[kept]) * rng.normal(1, 0.06, kept.sum()), 0, 1)
    points = np.column_stack([directions[kept] * measured[:, None], np.round(intensity, 2)])
    return Sweep(
        points=points.astype(np.float32),
        instances=scene.face_objects[faces[kept]],
        rings=lidar.rings()[kept],
        times=None if times is None else times[kept],
    )


def _reflectance(scene: Scene) -> Floats:
    """(F,) share of infrared light that each triangle sends back; leaves and grass are bright there."""
    value: Floats = 0.1 + 0.6 * scene.shape.colours.mean(axis=1).astype(np.float64)
    value[np.isin(scene.shape.materials, (Material.LEAF, Material.GRASS))] += 0.15
    value[scene.shape.materials == Material.REFLECTOR] = 1.0
    value[scene.shape.materials == Material.GLASS] = 0.08
    return value


def _returned(
    lidar: Lidar, ranges: Floats, cosine: Floats, reflectance: Floats, rng: np.random.Generator
) -> NDArray[np.bool_]:
    finite = np.where(np.isfinite(ranges), np.maximum(ranges, 0.1), 1e9)
    signal = lidar.sensitivity * reflectance * cosine * (lidar.max_range_m / finite) ** 2
    chance = (1 - lidar.dropout) * -np.expm1(-signal)
    in_range = (finite >= lidar.min_range_m) & (finite <= lidar.max_range_m)
    seen: NDArray[np.bool_] = in_range & (rng.random(len(finite)) < chance)
    return seen


def _noisy(lidar: Lidar, ranges: Floats, rng: np.random.Generator) -> Floats:
    noisy = ranges + rng.normal(0, 1, len(ranges)) * lidar.range_noise_m
    if lidar.range_step_m == 0:
        return noisy
    stepped: Floats = np.round(noisy / lidar.range_step_m) * lidar.range_step_m
    return stepped
