"""A street: traffic, parked cars, pavements with people, houses on both sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldls.simulation.ground import Ground, Strip
from ldls.simulation.layouts import pavement
from ldls.simulation.plan import Plan
from ldls.simulation.scene_object import BUS, CAR, MOTORCYCLE, TRUCK
from ldls.simulation.shapes import scenery, vehicles
from ldls.simulation.shapes.shape import Material

ASPHALT, PAVING = (0.30, 0.30, 0.32), (0.58, 0.56, 0.53)
KERB_M = 0.12


@dataclass(frozen=True)
class Profile:
    """A street across: the kerbs and the fronts of its houses, as y in metres."""

    right_kerb_m: float
    left_kerb_m: float
    right_front_m: float
    left_front_m: float


def street(rng: np.random.Generator) -> Plan:
    """A street along x around the sensor, which drives on the right."""
    right, left = -rng.uniform(3.9, 4.6), rng.uniform(6.6, 7.8)
    across = Profile(right, left, right - rng.uniform(4.0, 6.5), left + rng.uniform(4.0, 6.5))
    plan = Plan(_ground(across, rng))
    _traffic(plan, rng)
    _parked(plan, across, rng)
    for side, kerb, front in ((-1, right, across.right_front_m), (1, left, across.left_front_m)):
        _roadside(plan, side, kerb, rng)
        near, far = sorted((kerb + side * 1.2, front - side * 0.9))
        pavement.furnish(plan, (near, far), along_m=(5, 50), rng=rng)
        pavement.people(plan, (near - 0.4, far + 0.4), int(rng.integers(3, 9)), along_m=(4, 48), rng=rng)
    pavement.people(plan, (right + 0.8, left - 0.8), int(rng.integers(0, 4)), along_m=(7, 26), rng=rng, crossing=True)
    _houses(plan, across, rng)
    pavement.cyclists(plan, (right + 0.6, left - 0.6), rng=rng)
    return plan


def _ground(across: Profile, rng: np.random.Generator) -> Ground:
    right, left = across.right_kerb_m, across.left_kerb_m
    strips = (
        Strip(-60.0, right, KERB_M, PAVING, Material.PAVING),
        Strip(right, left, 0.0, ASPHALT, Material.ASPHALT),
        Strip(left, 60.0, KERB_M, PAVING, Material.PAVING),
    )
    slope = (float(rng.normal(0, 0.012)), float(rng.normal(0, 0.008)))
    return Ground(strips, slope, float(rng.uniform(0, 0.1)), float(rng.uniform(0, 6.28)))


def _traffic(plan: Plan, rng: np.random.Generator) -> None:
    """Vehicles ahead in the sensor's lane and in the one that comes towards it."""
    kinds = (
        (CAR, vehicles.car),
        (BUS, vehicles.bus),
        (TRUCK, vehicles.truck),
        (MOTORCYCLE, vehicles.motorcycle),
    )
    for lane_m, yaw, spots in ((0.0, 0.0, (16.0, 28.0, 42.0, -14.0)), (3.4, np.pi, (13.0, 23.0, 34.0, 48.0, -16.0))):
        for x in spots:
            if rng.random() < 0.45:
                category, build = kinds[int(rng.choice(4, p=(0.68, 0.1, 0.12, 0.1)))]
                turn, speed = yaw + rng.normal(0, 0.03), rng.uniform(3, 11)
                plan.put(
                    category, build(rng), x + rng.uniform(-3, 3), lane_m + rng.normal(0, 0.2), yaw=turn, speed_m_s=speed
                )


def _parked(plan: Plan, across: Profile, rng: np.random.Generator) -> None:
    for y, yaw in ((across.right_kerb_m + 1.15, 0.0), (across.left_kerb_m - 1.1, np.pi)):
        x, full = -25.0, rng.uniform(0.25, 0.75)
        while x < 55:
            beside = 3 < x < 9  # the mouth of a drive, often kept free
            if rng.random() < (0.4 * full if beside else full):
                truck = rng.random() < 0.06
                category, build = (TRUCK, vehicles.truck) if truck else (CAR, vehicles.car)
                turn = yaw + rng.normal(0, 0.025) + (np.pi if rng.random() < 0.15 else 0.0)
                plan.put(category, build(rng), x + rng.uniform(-0.3, 0.3), y + rng.normal(0, 0.08), yaw=turn)
            elif rng.random() < 0.15:
                plan.put(MOTORCYCLE, vehicles.motorcycle(rng), x, y, yaw=yaw + rng.normal(0, 0.3))
            x += rng.uniform(5.3, 6.8)


def _roadside(plan: Plan, side: int, kerb_m: float, rng: np.random.Generator) -> None:
    for x in np.arange(-28.0, 62.0, 9.0):
        build = (scenery.tree, scenery.lamp, scenery.sign, scenery.bollard)[
            int(rng.choice(4, p=(0.45, 0.3, 0.1, 0.15)))
        ]
        yaw = 0.0 if side < 0 or build is scenery.sign else np.pi
        plan.scenery(build(rng), x + rng.uniform(-2, 2), kerb_m + side * 0.55, yaw=yaw)


def _houses(plan: Plan, across: Profile, rng: np.random.Generator) -> None:
    for side, front in ((-1, across.right_front_m), (1, across.left_front_m)):
        x = -45.0
        while x < 85:
            length = rng.uniform(8, 15)
            if rng.random() < 0.85:
                yaw, setback = (0.0 if side > 0 else np.pi), rng.uniform(0, 0.8)
                house = scenery.house(length, 9.0, rng)
                plan.scenery(house, x + length / 2, front + side * setback, yaw=yaw, room_m=0)
            else:
                plan.scenery(scenery.bush(rng), x + length / 2, front + side * 1.5)
            x += length + 0.02
    end = scenery.house(60.0, 9.0, rng)
    plan.scenery(end, rng.uniform(75, 95), 0.0, yaw=-np.pi / 2, room_m=0)
