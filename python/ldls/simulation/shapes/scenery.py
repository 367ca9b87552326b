"""Things that stand still: houses, trees, bushes, lamps, bollards, signs, tables, benches, chairs and potted plants."""

from __future__ import annotations

import numpy as np

from ldls.simulation.shapes import paints
from ldls.simulation.shapes.primitives import ball, box, frustum, leaves, tube
from ldls.simulation.shapes.shape import Colour, Material, Shape, join

BARK: Colour = (0.30, 0.25, 0.20)
POST: Colour = (0.26, 0.28, 0.28)


def tree(rng: np.random.Generator) -> Shape:
    """A tree, 5 to 9 m tall; about half of the rays pass through its crown."""
    trunk, spread = rng.uniform(2.0, 3.0), rng.uniform(1.5, 2.6)
    green = (rng.uniform(0.2, 0.36), rng.uniform(0.34, 0.46), rng.uniform(0.1, 0.18))
    top = trunk + 0.9 * spread
    angles = rng.uniform(0, 2 * np.pi, 4)
    ends = [(0.6 * spread * np.cos(a), 0.6 * spread * np.sin(a), top + rng.uniform(-0.5, 0.5)) for a in angles]
    crown = leaves((0, 0, top), (spread, spread, 1.05 * spread), int(430 * spread**2), 0.2, green, rng)
    return join(
        [
            tube((0, 0, -0.1), (0, 0, top), rng.uniform(0.1, 0.22), BARK),
            *(tube((0, 0, trunk), end, 0.05, BARK, sides=6) for end in ends),
            crown,
        ]
    )


def bush(rng: np.random.Generator) -> Shape:
    """A bush, 0.5 to 1.4 m tall."""
    half = rng.uniform((0.5, 0.5, 0.3), (1.1, 1.1, 0.7))
    return leaves((0, 0, half[2]), half, 700, 0.14, (0.2, rng.uniform(0.33, 0.45), 0.13), rng)


def lamp(rng: np.random.Generator) -> Shape:
    """A street lamp, 5 to 7 m tall, its arm over the road at +y."""
    tall = rng.uniform(5.0, 7.0)
    return join(
        [
            tube((0, 0, 0), (0, 0, 0.9), 0.1, POST),
            tube((0, 0, 0.9), (0, 0, tall), 0.06, POST),
            tube((0, 0, tall), (0, 1.2, tall + 0.1), 0.04, POST, sides=6),
            ball((0, 1.3, tall + 0.08), (0.12, 0.32, 0.07), paints.LAMP, detail=1),
        ]
    )


def bollard(rng: np.random.Generator) -> Shape:
    """A bollard, about a metre tall and as slim as a leg."""
    tall = rng.uniform(0.8, 1.1)
    return join([tube((0, 0, 0), (0, 0, tall), 0.06, POST), ball((0, 0, tall), (0.08, 0.08, 0.08), POST, detail=1)])


def sign(rng: np.random.Generator) -> Shape:
    """A traffic sign that faces back along the road (-x)."""
    face = paints.TAIL_LAMP if rng.random() < 0.5 else (0.12, 0.25, 0.6)
    return join(
        [
            tube((0, 0, 0), (0, 0, 2.7), 0.03, paints.METAL, sides=6),
            tube((-0.04, 0, 2.4), (-0.06, 0, 2.4), 0.32, face, sides=20),
            box((-0.07, 0, 2.4), (0.01, 0.4, 0.12), paints.PLATE, Material.REFLECTOR),
        ]
    )


def house(length_m: float, depth_m: float, rng: np.random.Generator) -> Shape:
    """A house with a flat roof and a plinth; its front is the plane y = 0 and it stands at y > 0."""
    storeys = int(rng.integers(2, 5))
    tall, colour = 3.2 * storeys + 0.8, paints.pick(paints.PLASTER, rng)
    door = rng.uniform(-0.3, 0.3) * length_m
    return join(
        [
            box((0, depth_m / 2, tall / 2 - 1), (length_m, depth_m, tall + 2), colour, Material.FACADE),
            box((0, depth_m / 2, 0), (length_m + 0.08, depth_m + 0.08, 1.0), (0.4, 0.39, 0.37)),
            box((0, depth_m / 2, tall + 0.1), (length_m + 0.5, depth_m + 0.5, 0.25), (0.3, 0.29, 0.28)),
            box((door, -0.02, 1.1), (1.1, 0.12, 2.3), paints.WOOD),
            box((door, -0.35, 2.45), (1.7, 0.7, 0.1), (0.35, 0.35, 0.36)),
        ]
    )


def bench(rng: np.random.Generator) -> Shape:
    """A park bench that faces x, 1.5 to 2 m wide, with gaps between its slats."""
    wide = rng.uniform(1.5, 2.0)
    slats = [box((x, 0, 0.45), (0.1, wide, 0.035), paints.WOOD) for x in (-0.16, 0.0, 0.16)]
    back = [box((-0.25 - 0.2 * (z - 0.6), 0, z), (0.035, wide, 0.1), paints.WOOD) for z in (0.62, 0.8)]
    sides = [y * 0.42 * wide for y in (-1, 1)]
    legs = [
        tube((x, y, 0), (x, y, top), 0.03, paints.RUBBER, sides=6)
        for y in sides
        for x, top in ((0.18, 0.44), (-0.2, 0.55))
    ]
    posts = [tube((-0.2, y, 0.45), (-0.3, y, 0.85), 0.025, paints.RUBBER, sides=6) for y in sides]
    return join([*slats, *back, *legs, *posts])


def chair(rng: np.random.Generator) -> Shape:
    """A chair that faces x, with four thin legs."""
    colour = paints.pick(paints.PAINTS, rng)
    feet = [(x, y) for x in (-0.2, 0.2) for y in (-0.2, 0.2)]
    return join(
        [
            *(tube((x * 1.1, y * 1.1, 0), (x, y, 0.45), 0.018, paints.METAL, sides=6) for x, y in feet),
            box((0, 0, 0.46), (0.46, 0.46, 0.04), colour),
            *(tube((-0.21, y, 0.46), (-0.27, y, 0.9), 0.016, paints.METAL, sides=6) for y in (-0.2, 0.2)),
            box((-0.26, 0, 0.76), (0.035, 0.46, 0.28), colour),
        ]
    ).scaled(rng.uniform(0.95, 1.1))


def table(rng: np.random.Generator) -> Shape:
    """A round café table; it belongs to no object."""
    radius = rng.uniform(0.3, 0.42)
    return join(
        [
            tube((0, 0, 0.70), (0, 0, 0.73), radius, paints.METAL, sides=18),
            tube((0, 0, 0.02), (0, 0, 0.71), 0.035, paints.RUBBER),
            tube((0, 0, 0), (0, 0, 0.03), 0.6 * radius, paints.RUBBER, sides=14),
        ]
    )


def potted_plant(rng: np.random.Generator) -> Shape:
    """A shrub in a square tub, 0.9 to 1.7 m tall."""
    side, tub, spread = rng.uniform(0.22, 0.36), rng.uniform(0.35, 0.55), rng.uniform(0.35, 0.55)
    clay = (0.62, 0.42, 0.31) if rng.random() < 0.5 else (0.66, 0.64, 0.60)
    crown = leaves((0, 0, tub + 0.85 * spread), (spread, spread, spread), 420, 0.13, (0.22, 0.42, 0.14), rng)
    rim = box((0, 0, tub - 0.02), (2 * side + 0.06, 2 * side + 0.06, 0.06), clay)
    pot = frustum((-0.8 * side, 0.8 * side, 1.6 * side, 0), (-side, side, 2 * side, tub), clay)
    return join([pot, rim, tube((0, 0, tub), (0, 0, tub + spread), 0.03, paints.WOOD, sides=6), crown])
