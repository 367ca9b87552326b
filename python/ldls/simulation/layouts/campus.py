"""A campus: a wide path between lawns, people, bicycles, benches, trees, a few vehicles, large buildings."""

from __future__ import annotations

import numpy as np

from ldls.simulation.ground import Ground, Strip
from ldls.simulation.layouts import pavement
from ldls.simulation.plan import Plan
from ldls.simulation.scene_object import BICYCLE, BUS, CAR, TRUCK
from ldls.simulation.shapes import scenery, vehicles
from ldls.simulation.shapes.shape import Material

PATH, LAWN = (0.50, 0.48, 0.45), (0.25, 0.36, 0.15)


def campus(rng: np.random.Generator) -> Plan:
    """A path along x around the sensor, with lawns a kerb's height above it."""
    right, left = -rng.uniform(3.2, 5.0), rng.uniform(3.2, 6.0)
    plan = Plan(_ground(right, left, rng))
    _vehicles(plan, right, left, rng)
    pavement.people(plan, (right + 0.4, left - 0.4), int(rng.integers(5, 11)), along_m=(5, 40), rng=rng)
    pavement.people(plan, (right + 0.4, left - 0.4), int(rng.integers(1, 4)), along_m=(7, 25), rng=rng, crossing=True)
    for across in ((right - 9, right - 0.6), (left + 0.6, left + 9)):
        pavement.furnish(plan, across, along_m=(5, 35), rng=rng)
        pavement.people(plan, across, int(rng.integers(1, 5)), along_m=(6, 45), rng=rng)
        _racks(plan, across, rng)
        _greenery(plan, across, rng)
    _buildings(plan, right, left, rng)
    pavement.cyclists(plan, (right + 0.6, left - 0.6), rng=rng)
    return plan


def _ground(right: float, left: float, rng: np.random.Generator) -> Ground:
    up = rng.uniform(0.04, 0.12)
    strips = (
        Strip(-60.0, right, up, LAWN, Material.GRASS),
        Strip(right, left, 0.0, PATH, Material.PAVING),
        Strip(left, 60.0, up, LAWN, Material.GRASS),
    )
    slope = (float(rng.normal(0, 0.02)), float(rng.normal(0, 0.015)))
    return Ground(strips, slope, float(rng.uniform(0.05, 0.25)), float(rng.uniform(0, 6.28)))


def _vehicles(plan: Plan, right: float, left: float, rng: np.random.Generator) -> None:
    """A row of parked cars beside the path, and perhaps a truck that delivers or a bus that waits."""
    side, start = (right - 1.3, left + 1.3)[int(rng.integers(2))], rng.uniform(6, 20)
    for k in range(int(rng.integers(2, 7))):
        yaw = np.pi * rng.integers(2) + rng.normal(0, 0.05)
        plan.put(CAR, vehicles.car(rng), start + 5.6 * k, side, yaw=yaw)
    if rng.random() < 0.5:
        yaw, speed = np.pi * rng.integers(2), rng.uniform(2, 5)
        plan.put(CAR, vehicles.car(rng), rng.uniform(10, 35), 0.0, yaw=yaw, speed_m_s=speed)
    for category, build, chance in ((TRUCK, vehicles.truck, 0.35), (BUS, vehicles.bus, 0.2)):
        if rng.random() < chance:
            y = (right - 2.5, left + 2.5)[int(rng.integers(2))]
            plan.put(category, build(rng), rng.uniform(18, 50), y, yaw=rng.normal(0, 0.1))


def _racks(plan: Plan, across_m: tuple[float, float], rng: np.random.Generator) -> None:
    """A row of bicycles side by side."""
    x, y = rng.uniform(7, 28), rng.uniform(*across_m)
    for k in range(int(rng.integers(0, 6))):
        yaw = np.pi / 2 + rng.normal(0, 0.08)
        plan.put(BICYCLE, vehicles.bicycle(rng), x + 0.75 * k, y, yaw=yaw)


def _greenery(plan: Plan, across_m: tuple[float, float], rng: np.random.Generator) -> None:
    for _ in range(int(rng.integers(3, 8))):
        plan.scenery(scenery.tree(rng), rng.uniform(-25, 55), rng.uniform(*across_m), room_m=0.5)
    for _ in range(int(rng.integers(1, 6))):
        plan.scenery(scenery.bush(rng), rng.uniform(-20, 45), rng.uniform(*across_m), room_m=0.8)
    edge = across_m[1] if across_m[1] < 0 else across_m[0]
    for x in np.arange(-20.0, 55.0, 15.0):
        build = (scenery.lamp, scenery.bollard)[int(rng.integers(2))]
        plan.scenery(build(rng), x + rng.uniform(-3, 3), edge, yaw=0.0 if edge < 0 else np.pi)


def _buildings(plan: Plan, right: float, left: float, rng: np.random.Generator) -> None:
    for side, edge in ((-1, right), (1, left)):
        x = -40.0
        while x < 85:
            length = rng.uniform(18, 35)
            house, front = scenery.house(length, 14.0, rng), edge + side * rng.uniform(10.5, 15)
            plan.scenery(house, x + length / 2, front, yaw=0.0 if side > 0 else np.pi, room_m=0)
            x += length + rng.uniform(2, 12)
    plan.scenery(scenery.house(70.0, 14.0, rng), rng.uniform(70, 95), 0.0, yaw=-np.pi / 2, room_m=0)
