"""Benches, chairs, café tables and potted plants."""

from __future__ import annotations

import numpy as np

from ldls.simulation.shapes import paints
from ldls.simulation.shapes.primitives import box, frustum, leaves, tube
from ldls.simulation.shapes.shape import Shape, join


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
