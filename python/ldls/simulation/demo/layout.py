"""What stands where in a made-up street. It runs along x, around a sensor 1.73 m above it."""

from typing import NamedTuple

import numpy as np

from ldls.simulation.demo import models
from ldls.simulation.demo.solids import GROUND_M, I32, Part, Shape, Solids, Surface, Vector, place

KERB_M = 0.12
ROAD_M = (-3.7, 6.8)  # y of the kerbs
PERSON, BICYCLE, CAR, BUS, BENCH, DOG, POTTED_PLANT = 1, 2, 3, 6, 15, 18, 64  # COCO


def _colours(codes: str) -> list[Vector]:
    """Return colours in [0, 1] from hexadecimal RGB."""
    return [(r / 255, g / 255, b / 255) for r, g, b in map(bytes.fromhex, codes.split())]


PAINTS = _colours("991717 214285 cccfd1 33614c c79429 5c616b")
SHIRTS = _colours("d14238 3870b2 e6dbc7 859e4c 75427a eb9e33")
TROUSERS = _colours("2b385c 333030 75634c")
COATS = _colours("c29e6b 4c3321 dbd1bd")
PLASTER = _colours("ccb88f b8947a d1ccbd b28066 a3b0b2 dbc285 99a385")


class Placed(NamedTuple):
    """One object of the street, none inside another; `at_m` is its model's origin."""

    category: int
    parts: list[Part]
    at_m: Vector
    yaw_deg: float


def street(rng: np.random.Generator) -> tuple[Solids, I32]:
    """Return a street and the category of each of its objects; owner m is categories[m - 1]."""
    things = [*_on_the_road(rng), *_on_the_pavements(rng)]
    placed = [place(one.parts, one.at_m, one.yaw_deg, m) for m, one in enumerate(things, start=1)]
    categories = np.array([thing.category for thing in things], np.int32)
    return Solids.join([*_scenery(rng), *placed]), categories


def _scenery(rng: np.random.Generator) -> list[Solids]:
    """Return what belongs to no object: the ground, houses, trees and street lamps."""
    houses = [part for side in (-1, 1) for part in _terrace(rng, side)]
    end = _block((66, -30, 0), (78, 34, 9.7), PLASTER[2], Surface.FACADE)
    trees = [(models.tree(rng), x, y) for x, y in ((27, -4.6), (44, -4.6), (21, 7.3), (36, 7.3))]
    lamps = [(models.street_lamp(), x, y) for x, y in ((14.0, -4.1), (34, -4.1), (12.6, 7.2))]
    return [
        place([*_ground(), *houses, end], (0, 0, GROUND_M)),
        *(place(parts, _near(rng, x, y, 0.8, 0.05)) for parts, x, y in trees + lamps),
    ]


def _block(low_m: Vector, high_m: Vector, colour: Vector, surface: Surface) -> Part:
    low, high = np.array(low_m), np.array(high_m)
    (cx, cy, cz), (hx, hy, hz) = (low + high) / 2, (high - low) / 2
    return Part(Shape.BOX, (cx, cy, cz), (hx, hy, hz), colour, surface=surface)


def _ground() -> list[Part]:
    right, left = ROAD_M
    paving = (0.62, 0.60, 0.57)
    return [
        _block((-60, right - 2, -1), (80, left + 2, 0), (0.33, 0.33, 0.35), Surface.ASPHALT),
        _block((-60, right - 30, -1), (80, right, KERB_M), paving, Surface.PAVING),
        _block((-60, left, -1), (80, left + 30, KERB_M), paving, Surface.PAVING),
    ]


def _terrace(rng: np.random.Generator, side: int) -> list[Part]:
    """Return a row of houses, on the left (1) or the right (-1)."""
    houses, x = [], -32.0
    while x < 60:
        front = (11.0 if side > 0 else 7.9) + rng.uniform(0, 0.7)
        length, height = rng.uniform(8, 14), 3.2 + 3.0 * rng.integers(1, 4) + 0.5
        near, far = sorted((side * front, side * (front + 9)))
        colour = PLASTER[rng.integers(len(PLASTER))]
        houses.append(_block((x, near, 0), (x + length, far, height), colour, Surface.FACADE))
        x += length
    return houses


def _on_the_road(rng: np.random.Generator) -> list[Placed]:
    paints = [PAINTS[i] for i in rng.permutation(len(PAINTS))]
    parked = ((9.8, -2.6, 0), (16.4, -2.6, 0), (15.6, 5.6, 180))
    cars = [
        Placed(CAR, models.car(paint), _near(rng, x, y, 0.5, 0.1), yaw_deg + rng.uniform(-2, 2))
        for (x, y, yaw_deg), paint in zip(parked, paints, strict=False)
    ]
    bus = Placed(BUS, models.bus(paints[3]), _near(rng, 32, 3.1, 3, 0.3), 180 + rng.uniform(-3, 3))
    walker = Placed(PERSON, _walker(rng), _near(rng, 11.5, 1.2, 1.5, 0.8), rng.uniform(60, 120))
    return [*cars, bus, walker]


def _on_the_pavements(rng: np.random.Generator) -> list[Placed]:
    """Return what may stand on either pavement, shuffled over a few free places."""
    right = [(x, -5.6, 0) for x in (8.6, 11.0, 13.4, 17.0)]
    left = [(x, 8.8, 180) for x in (12.0, 14.4, 16.8, 20.4)]
    spots = [(right + left)[i] for i in rng.permutation(8)]
    along = rng.uniform(-20, 20)
    models_of = [
        (PERSON, _walker(rng), along),
        (PERSON, _walker(rng), along + 180),
        (PERSON, models.person(*_outfit(rng), stride_m=0.06), rng.uniform(0, 360)),
        (DOG, models.dog(COATS[rng.integers(len(COATS))]), along + 180),
        (BICYCLE, models.bicycle(PAINTS[rng.integers(len(PAINTS))]), along),
        (POTTED_PLANT, models.potted_plant(rng), 0.0),
        (BENCH, models.bench(), 90.0),
    ]
    return [
        Placed(category, parts, _near(rng, x, y, 0.3, 0.7, KERB_M), yaw_deg + turn_deg)
        for (category, parts, yaw_deg), (x, y, turn_deg) in zip(models_of, spots, strict=False)
    ]


def _near(rng: np.random.Generator, x: float, y: float, dx: float, dy: float, up_m: float = 0.0) -> Vector:
    """Return a place on the ground within (dx, dy) of (x, y)."""
    return x + rng.uniform(-dx, dx), y + rng.uniform(-dy, dy), GROUND_M + up_m


def _walker(rng: np.random.Generator) -> list[Part]:
    return models.person(*_outfit(rng))


def _outfit(rng: np.random.Generator) -> tuple[Vector, Vector]:
    return SHIRTS[rng.integers(len(SHIRTS))], TROUSERS[rng.integers(len(TROUSERS))]
