"""Bicycles and motorcycles: thin tubes and rings that rays pass between."""

from __future__ import annotations

import numpy as np

from ldls.simulation.shapes import paints
from ldls.simulation.shapes.primitives import ball, box, ring, tube
from ldls.simulation.shapes.shape import Shape, join

FRAME_TUBES = (
    ((-0.52, 0, 0.34), (-0.05, 0, 0.30)),
    ((-0.52, 0, 0.34), (-0.20, 0, 0.80)),
    ((-0.05, 0, 0.30), (-0.22, 0, 0.92)),
    ((-0.05, 0, 0.30), (0.36, 0, 0.80)),
    ((-0.19, 0, 0.78), (0.35, 0, 0.84)),
    ((0.52, 0, 0.34), (0.33, 0, 1.02)),
)


def bicycle(rng: np.random.Generator) -> Shape:
    """A bicycle, about 1.75 m long."""
    paint = paints.pick(paints.PAINTS, rng)
    wheels = [ring((x, 0, 0.34), 0.32, 0.022, paints.RUBBER) for x in (-0.52, 0.52)]
    angles = np.linspace(0, np.pi, 4, endpoint=False) + rng.uniform(0, 0.7)
    reach = [(0.31 * np.cos(a), 0.31 * np.sin(a)) for a in angles]
    spokes = [
        tube((x - dx, 0, 0.34 - dz), (x + dx, 0, 0.34 + dz), 0.004, paints.METAL, sides=3)
        for x in (-0.52, 0.52)
        for dx, dz in reach
    ]
    frame = [tube(start, end, 0.022, paint, sides=6) for start, end in FRAME_TUBES]
    handlebar = tube((0.34, -0.28, 1.04), (0.34, 0.28, 1.04), 0.016, paints.RUBBER, sides=6)
    saddle = ball((-0.23, 0, 0.95), (0.13, 0.08, 0.04), paints.RUBBER, detail=1)
    return join([*wheels, *spokes, *frame, handlebar, saddle]).scaled(rng.uniform(0.93, 1.05))


def motorcycle(rng: np.random.Generator) -> Shape:
    """A motorcycle on its stand, about 2.1 m long."""
    paint = paints.pick(paints.PAINTS, rng)
    return join(
        [
            *(ring((x, 0, 0.31), 0.25, 0.06, paints.RUBBER) for x in (-0.68, 0.72)),
            *(tube((x, -0.03, 0.31), (x, 0.03, 0.31), 0.2, paints.METAL) for x in (-0.68, 0.72)),
            box((-0.02, 0, 0.45), (0.52, 0.30, 0.36), paints.METAL),
            ball((0.16, 0, 0.80), (0.30, 0.15, 0.15), paint),
            ball((-0.42, 0, 0.80), (0.42, 0.14, 0.07), paints.RUBBER, detail=1),
            ball((-0.78, 0, 0.78), (0.20, 0.10, 0.07), paint, detail=1),
            box((-0.92, 0, 0.66), (0.03, 0.18, 0.14), paints.PLATE),
            *(tube((0.72, y, 0.31), (0.42, y, 1.0), 0.03, paints.METAL, sides=6) for y in (-0.09, 0.09)),
            *(tube((-0.68, y, 0.31), (-0.1, y, 0.36), 0.035, paints.METAL, sides=6) for y in (-0.11, 0.11)),
            tube((0.38, -0.36, 1.04), (0.38, 0.36, 1.04), 0.018, paints.RUBBER, sides=6),
            ball((0.54, 0, 0.92), (0.1, 0.1, 0.1), paints.LAMP, detail=1),
            tube((-0.1, 0.15, 0.3), (-0.15, 0.35, 0.0), 0.015, paints.METAL, sides=4),
        ]
    ).scaled(rng.uniform(0.95, 1.06))
