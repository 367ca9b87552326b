"""Things and people on pavements and paths, and cyclists between the kerbs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ldls.simulation.plan import Plan
from ldls.simulation.scene_object import BENCH, BICYCLE, CHAIR, CYCLIST, DOG, MOTORCYCLE, PERSON, POTTED_PLANT
from ldls.simulation.shapes import figures, scenery, vehicles
from ldls.simulation.shapes.shape import Shape

Range = tuple[float, float]
THINGS: tuple[tuple[int, Callable[[np.random.Generator], Shape], float], ...] = (
    (BICYCLE, vehicles.bicycle, 1.4),
    (BENCH, scenery.bench, 0.9),
    (POTTED_PLANT, scenery.potted_plant, 1.1),
    (DOG, figures.dog, 0.5),
    (MOTORCYCLE, vehicles.motorcycle, 0.3),
)
"""Category, shape, and how many there are on average to a pavement."""
ONE_MORE_CYCLIST = 0.5
"""Chance that one more rides in a scene, where there is room."""
CYCLISTS_ALONG_M: Range = (6, 40)


def furnish(plan: Plan, across_m: Range, *, along_m: Range, rng: np.random.Generator) -> None:
    """Put bicycles, benches, plants, dogs, bushes and perhaps a café between two y and two x."""
    for category, build, count in THINGS:
        for _ in range(int(rng.poisson(count))):
            yaw = rng.normal(0, 0.2) + np.pi * rng.integers(2)
            speed = 0.8 if category == DOG else 0.0
            turn = np.pi / 2 if category == BENCH else 0.0
            plan.put(category, build(rng), *_place(across_m, along_m, rng), yaw=yaw + turn, speed_m_s=speed)
    for _ in range(int(rng.poisson(1.0))):
        plan.scenery(scenery.bush(rng), *_place(across_m, along_m, rng), room_m=0.7)
    if rng.random() < 0.5:
        cafe(plan, *_place(across_m, (along_m[0], 0.5 * sum(along_m)), rng), rng)


def cafe(plan: Plan, x_m: float, y_m: float, rng: np.random.Generator) -> None:
    """Put tables there with two to four chairs around each."""
    for dx in (0.0, 2.3):
        plan.scenery(scenery.table(rng), x_m + dx, y_m, room_m=0.3)
        for angle in rng.uniform(0, 0.6) + np.arange(int(rng.integers(2, 5))) * (np.pi / 2):
            x, y = x_m + dx + 0.72 * np.cos(angle), y_m + 0.72 * np.sin(angle)
            plan.put(CHAIR, scenery.chair(rng), x, y, yaw=angle + np.pi + rng.normal(0, 0.2))


def people(
    plan: Plan, across_m: Range, groups: int, *, along_m: Range, rng: np.random.Generator, crossing: bool = False
) -> None:
    """Put `groups` of one to three people there, who stand, or walk along x, or across it if `crossing`."""
    for _ in range(groups):
        x, y = _place(across_m, along_m, rng)
        walking = crossing or rng.random() < 0.7
        yaw = np.pi * rng.integers(2) + rng.normal(0, 0.15) + (np.pi / 2 if crossing else 0.0)
        for member in range(int(rng.choice([1, 2, 3], p=[0.6, 0.3, 0.1]))):
            turn = yaw + rng.normal(0, 0.1) if walking else rng.uniform(0, 2 * np.pi)
            dx, dy = -0.62 * member * np.sin(yaw), 0.62 * member * np.cos(yaw)
            body = figures.person(rng, walking=walking)
            speed = rng.uniform(0.9, 1.7) if walking else 0.0
            plan.put(PERSON, body, x + dx + rng.normal(0, 0.12), y + dy, yaw=turn, speed_m_s=speed)


def cyclists(plan: Plan, across_m: Range, *, rng: np.random.Generator) -> None:
    """Put people on bicycles there, who ride along x and keep to the right."""
    while rng.random() < ONE_MORE_CYCLIST:
        x, y = _place(across_m, CYCLISTS_ALONG_M, rng)
        yaw = (0.0 if y < np.mean(across_m) else np.pi) + rng.normal(0, 0.05)
        bicycle = vehicles.bicycle(rng)
        parts = {PERSON: figures.rider(bicycle, rng), BICYCLE: bicycle}
        plan.put(CYCLIST, parts, x, y, yaw=yaw, speed_m_s=rng.uniform(3, 6))


def _place(across_m: Range, along_m: Range, rng: np.random.Generator) -> tuple[float, float]:
    return float(rng.uniform(*along_m)), float(rng.uniform(*across_m))
