"""Models of what stands in a street, each a list of parts on the ground at its own origin."""

import numpy as np

from ldls.simulation.demo.solids import Part, Shape, Surface, Vector

BOX, CYLINDER, BALL = Shape.BOX, Shape.CYLINDER, Shape.ELLIPSOID
RUBBER: Vector = (0.07, 0.07, 0.08)
GLASS: Vector = (0.13, 0.17, 0.21)
METAL: Vector = (0.55, 0.57, 0.60)
SKIN: Vector = (0.78, 0.57, 0.45)
WOOD: Vector = (0.50, 0.33, 0.19)
LAMP: Vector = (0.98, 0.96, 0.86)
TAIL_LAMP: Vector = (0.75, 0.06, 0.06)


def _wheels(axles_m: tuple[float, ...], track_m: float, radius_m: float) -> list[Part]:
    sides = [(x, y) for x in axles_m for y in (-track_m, track_m)]
    return [
        part
        for x, y in sides
        for part in (
            Part(CYLINDER, (x, y, radius_m), (radius_m, radius_m, 0.11), RUBBER, roll_deg=90),
            Part(CYLINDER, (x, y, radius_m), (radius_m * 0.6,) * 2 + (0.12,), METAL, roll_deg=90),
        )
    ]


def _pair(shape: Shape, centre_m: Vector, half_m: Vector, colour: Vector) -> list[Part]:
    x, y, z = centre_m
    return [Part(shape, (x, side * y, z), half_m, colour) for side in (-1, 1)]


def car(paint: Vector) -> list[Part]:
    """Return a saloon, 4.3 m long."""
    return [
        Part(BOX, (0, 0, 0.44), (2.08, 0.82, 0.19), paint),
        Part(BOX, (-0.05, 0, 0.68), (2.02, 0.87, 0.18), paint),
        Part(BALL, (1.55, 0, 0.78), (0.62, 0.83, 0.18), paint),
        Part(BOX, (-0.30, 0, 1.12), (0.86, 0.70, 0.30), GLASS),
        Part(BOX, (0.50, 0, 1.06), (0.50, 0.69, 0.18), GLASS, pitch_deg=30),
        Part(BOX, (-1.08, 0, 1.08), (0.44, 0.69, 0.18), GLASS, pitch_deg=-33),
        Part(BOX, (-0.30, 0, 1.43), (0.82, 0.68, 0.035), paint),
        Part(BOX, (-0.28, 0, 1.13), (0.05, 0.715, 0.30), paint),
        Part(BOX, (2.06, 0, 0.38), (0.06, 0.70, 0.10), RUBBER),
        Part(BOX, (-2.08, 0, 0.38), (0.05, 0.70, 0.08), RUBBER),
        Part(BOX, (-2.08, 0, 0.62), (0.02, 0.26, 0.07), LAMP),
        *_pair(BOX, (1.98, 0.66, 0.66), (0.12, 0.16, 0.07), LAMP),
        *_pair(BOX, (-2.04, 0.68, 0.74), (0.05, 0.15, 0.08), TAIL_LAMP),
        *_pair(BALL, (0.62, 0.93, 1.00), (0.08, 0.11, 0.07), paint),
        *_wheels((1.30, -1.30), 0.76, 0.32),
    ]


def bus(paint: Vector) -> list[Part]:
    """Return a city bus, 11 m long."""
    return [
        Part(BOX, (0, 0, 1.65), (5.50, 1.25, 1.35), paint),
        Part(BOX, (-0.2, 0, 1.95), (5.10, 1.265, 0.48), GLASS),
        Part(BOX, (0, 0, 1.85), (5.52, 1.12, 0.66), GLASS),
        Part(BOX, (0, 0, 2.72), (5.53, 0.75, 0.14), RUBBER),
        Part(BOX, (0, 0, 0.55), (5.53, 1.20, 0.08), RUBBER),
        Part(BOX, (-1.0, 0, 3.08), (3.20, 0.90, 0.10), (0.80, 0.80, 0.80)),
        *_pair(BOX, (5.50, 0.95, 0.85), (0.05, 0.18, 0.10), LAMP),
        *_pair(BOX, (-5.50, 1.05, 0.95), (0.05, 0.10, 0.22), TAIL_LAMP),
        *_wheels((3.2, -2.9), 1.12, 0.48),
    ]


def _limb(start_m: Vector, end_m: Vector, radius_m: float, colour: Vector) -> Part:
    """Return a cylinder from one joint to the next, in a plane of constant y."""
    (x0, y, z0), (x1, _, z1) = start_m, end_m
    length_m = float(np.hypot(x1 - x0, z1 - z0))
    pitch_deg = float(np.degrees(np.arctan2(x1 - x0, z1 - z0)))
    centre_m = ((x0 + x1) / 2, y, (z0 + z1) / 2)
    return Part(CYLINDER, centre_m, (radius_m, radius_m, length_m / 2), colour, pitch_deg)


def person(shirt: Vector, trousers: Vector, stride_m: float = 0.24) -> list[Part]:
    """Return a walker, 1.75 m tall; a stride of 0 stands still."""
    parts = [
        Part(CYLINDER, (0, 0, 0.93), (0.12, 0.17, 0.10), trousers),
        Part(CYLINDER, (0, 0, 1.20), (0.12, 0.18, 0.22), shirt),
        Part(BALL, (0, 0, 1.40), (0.12, 0.22, 0.10), shirt),
        Part(CYLINDER, (0.01, 0, 1.48), (0.05, 0.05, 0.06), SKIN),
        Part(BALL, (0.02, 0, 1.62), (0.095, 0.08, 0.125), SKIN),
        Part(BALL, (-0.015, 0, 1.66), (0.10, 0.09, 0.11), (0.20, 0.13, 0.09)),
    ]
    for side in (-1, 1):
        foot_m, hand_m = side * stride_m, -0.8 * side * stride_m
        leg, arm = side * 0.085, side * 0.235
        parts += [
            _limb((foot_m, leg, 0.08), (0, leg, 0.90), 0.075, trousers),
            Part(BOX, (foot_m + 0.06, leg, 0.04), (0.13, 0.045, 0.04), RUBBER),
            _limb((hand_m * 0.4, arm, 1.12), (0, arm, 1.42), 0.048, shirt),
            _limb((hand_m, arm, 0.86), (hand_m * 0.4, arm, 1.14), 0.04, SKIN),
        ]
    return parts


def bicycle(paint: Vector) -> list[Part]:
    """Return a bicycle, 1.75 m long; its wheels are rings, so rays pass between the spokes."""
    rings = [Part(CYLINDER, (x, 0, 0.34), (0.34, 0.34, 0.022), RUBBER, roll_deg=90, bore=0.84) for x in (-0.52, 0.52)]
    tubes = [
        ((-0.52, 0, 0.34), (-0.05, 0, 0.30)),
        ((-0.52, 0, 0.34), (-0.20, 0, 0.80)),
        ((-0.05, 0, 0.30), (-0.22, 0, 0.90)),
        ((-0.05, 0, 0.30), (0.36, 0, 0.80)),
        ((-0.19, 0, 0.78), (0.35, 0, 0.84)),
        ((0.52, 0, 0.34), (0.33, 0, 0.98)),
    ]
    return [
        *rings,
        *(_limb(start_m, end_m, 0.024, paint) for start_m, end_m in tubes),
        Part(BALL, (-0.23, 0, 0.92), (0.13, 0.08, 0.04), RUBBER),
        Part(BOX, (0.36, 0, 1.00), (0.03, 0.28, 0.025), RUBBER),
    ]


def dog(coat: Vector) -> list[Part]:
    """Return a dog, 0.6 m at the shoulder."""
    steps = ((0.3, 0.1, 0.1), (0.3, -0.1, -0.06), (-0.3, 0.1, -0.1), (-0.3, -0.1, 0.08))
    legs = [_limb((x + step, y, 0), (x, y, 0.42), 0.04, coat) for x, y, step in steps]
    return [
        *legs,
        Part(BALL, (0.0, 0, 0.50), (0.43, 0.15, 0.16), coat),
        Part(BALL, (0.27, 0, 0.52), (0.19, 0.16, 0.19), coat),
        Part(BALL, (0.44, 0, 0.68), (0.12, 0.09, 0.16), coat, pitch_deg=35),
        Part(BALL, (0.54, 0, 0.78), (0.13, 0.09, 0.10), coat),
        Part(BOX, (0.67, 0, 0.74), (0.08, 0.045, 0.04), coat, pitch_deg=10),
        Part(BALL, (0.76, 0, 0.75), (0.02, 0.03, 0.02), RUBBER),
        *_pair(BALL, (0.48, 0.09, 0.80), (0.06, 0.03, 0.10), WOOD),
        _limb((-0.64, 0, 0.72), (-0.40, 0, 0.56), 0.03, coat),
    ]


def _leaves(rng: np.random.Generator, top_m: float, spread_m: float, count: int) -> list[Part]:
    """Return a crown of `count` clumps around (0, 0, top_m)."""
    turn = 2.4 * np.arange(count) + rng.uniform(-0.6, 0.6, count)  # 2.4: the golden angle
    lift = np.linspace(-0.8, 0.9, count)
    reach = spread_m * rng.uniform(0.35, 0.85, count) * np.sqrt(1 - lift**2)
    size_m = spread_m * rng.uniform(0.24, 0.48, count)
    green = rng.uniform(0.75, 1.2, count)
    return [
        Part(
            BALL,
            (float(r * np.cos(a)), float(r * np.sin(a)), float(top_m + z * spread_m)),
            (float(s), float(s), float(0.8 * s)),
            (0.25 * g, 0.37 * g, 0.14 * g),
            surface=Surface.FOLIAGE,
        )
        for a, z, r, s, g in zip(turn, lift, reach, size_m, green, strict=True)
    ]


def potted_plant(rng: np.random.Generator) -> list[Part]:
    """Return a shrub in a tub, 1.6 m tall."""
    return [
        Part(CYLINDER, (0, 0, 0.30), (0.40, 0.40, 0.30), (0.66, 0.60, 0.52)),
        Part(CYLINDER, (0, 0, 0.58), (0.44, 0.44, 0.05), (0.70, 0.64, 0.56)),
        *_leaves(rng, 1.05, 0.55, 30),
    ]


def bench() -> list[Part]:
    """Return a park bench, 1.8 m long, that faces its x axis."""
    slats = [((x, 0, 0.45), (0.055, 0.90, 0.02), 0.0) for x in (-0.14, 0.0, 0.14)]
    back = [((-0.24 - 0.2 * (z - 0.6), 0, z), (0.02, 0.90, 0.055), -12.0) for z in (0.6, 0.76)]
    return [
        *(Part(BOX, centre_m, half_m, WOOD, pitch) for centre_m, half_m, pitch in slats + back),
        *_pair(BOX, (0.0, 0.72, 0.42), (0.20, 0.03, 0.02), RUBBER),
        *_pair(BOX, (0.17, 0.72, 0.21), (0.025, 0.03, 0.21), RUBBER),
        *_pair(BOX, (-0.20, 0.72, 0.40), (0.025, 0.03, 0.40), RUBBER),
    ]


def tree(rng: np.random.Generator) -> list[Part]:
    """Return a street tree, 6 m tall."""
    trunk = Part(CYLINDER, (0, 0, 1.5), (0.14, 0.14, 1.5), (0.33, 0.27, 0.21))
    return [trunk, *_leaves(rng, 4.2, 1.75, 60)]


def street_lamp() -> list[Part]:
    """Return a lamp post, 5 m tall."""
    post = (0.22, 0.26, 0.25)
    return [
        Part(CYLINDER, (0, 0, 0.4), (0.11, 0.11, 0.4), post),
        Part(CYLINDER, (0, 0, 2.4), (0.06, 0.06, 2.4), post),
        Part(BALL, (0, 0, 4.9), (0.22, 0.22, 0.24), LAMP),
        Part(CYLINDER, (0, 0, 5.1), (0.30, 0.30, 0.04), post),
    ]
