"""Cars, buses and trucks, whose glass lets a laser pass; bicycles and motorcycles, of thin tubes."""

from __future__ import annotations

import numpy as np

from ldls.simulation.shapes import paints
from ldls.simulation.shapes.primitives import ball, box, frustum, ring, tube, wheel
from ldls.simulation.shapes.shape import Colour, Material, Shape, join

SEAT: Colour = (0.13, 0.13, 0.14)
FRAME_TUBES = (
    ((-0.52, 0, 0.34), (-0.05, 0, 0.30)),
    ((-0.52, 0, 0.34), (-0.20, 0, 0.80)),
    ((-0.05, 0, 0.30), (-0.22, 0, 0.92)),
    ((-0.05, 0, 0.30), (0.36, 0, 0.80)),
    ((-0.19, 0, 0.78), (0.35, 0, 0.84)),
    ((0.52, 0, 0.34), (0.33, 0, 1.02)),
)


def car(rng: np.random.Generator) -> Shape:
    """A saloon, a hatchback or an estate, 3.7 to 4.9 m long."""
    length, width, height = rng.uniform(3.7, 4.9), rng.uniform(1.62, 1.85), rng.uniform(1.4, 1.68)
    paint, belt = paints.pick(paints.PAINTS, rng), 0.56 * height + 0.04
    nose, tail = length / 2, -length / 2
    boot = rng.uniform(0.05, 0.75)
    screen, back = nose - rng.uniform(0.95, 1.2), tail + boot
    low, high = (back, screen, width - 0.08, belt), (back + 0.35, screen - 0.7, width - 0.42, height - 0.05)
    return join(
        [
            *_body(nose, tail, width, belt, paint),
            frustum(low, high, paints.GLASS, Material.GLASS),
            *_pillars(low, high, paint),
            box(((high[0] + high[1]) / 2, 0, height - 0.03), (high[1] - high[0] + 0.06, high[2] + 0.04, 0.06), paint),
            *_seats((back + 0.7, screen - 1.0), belt, width),
            *_lamps(nose, tail, width, belt - 0.16),
            *_wheels((nose - 0.8, tail + 0.75), width / 2 - 0.12, 0.32, 0.2),
        ]
    )


def _body(nose: float, tail: float, width: float, belt: float, paint: Colour) -> list[Shape]:
    """Sills, sides and a sloping bonnet; the floor is 0.2 m above the ground."""
    return [
        frustum((tail + 0.12, nose - 0.1, width - 0.1, 0.2), (tail, nose, width, 0.42), paint),
        frustum((tail, nose, width, 0.42), (tail + 0.08, nose - 0.12, width - 0.04, belt - 0.14), paint),
        frustum(
            (tail + 0.08, nose - 0.12, width - 0.04, belt - 0.14), (tail + 0.2, nose - 0.75, width - 0.14, belt), paint
        ),
        box((nose - 0.01, 0, 0.4), (0.06, 0.8 * width, 0.16), paints.RUBBER),
        box((tail + 0.01, 0, 0.4), (0.06, 0.8 * width, 0.14), paints.RUBBER),
    ]


def _pillars(low: tuple[float, ...], high: tuple[float, ...], paint: Colour) -> list[Shape]:
    middle = ((low[0] + low[1]) / 2, (high[0] + high[1]) / 2)
    ends = [(low[0], high[0]), middle, (low[1], high[1])]
    return [
        tube((x0, side * low[2] / 2, low[3]), (x1, side * high[2] / 2, high[3]), 0.045, paint, sides=6)
        for x0, x1 in ends
        for side in (-1, 1)
    ]


def _seats(rows_x: tuple[float, float], belt: float, width: float) -> list[Shape]:
    return [
        box((x, side * 0.22 * width, belt + 0.05), (0.16, 0.3 * width, 0.5), SEAT) for x in rows_x for side in (-1, 1)
    ]


def _lamps(nose: float, tail: float, width: float, z: float) -> list[Shape]:
    side_m = 0.36 * width
    front = [box((nose - 0.1, s * side_m, z - 0.04), (0.16, 0.26, 0.12), paints.LAMP) for s in (-1, 1)]
    rear = [box((tail + 0.06, s * (side_m + 0.04), z), (0.1, 0.2, 0.16), paints.TAIL_LAMP) for s in (-1, 1)]
    plates = [box((x, 0, 0.5), (0.03, 0.5, 0.11), paints.PLATE, Material.REFLECTOR) for x in (nose, tail)]
    return [*front, *rear, *plates]


def _wheels(axles_m: tuple[float, ...], track_m: float, radius_m: float, width_m: float) -> list[Shape]:
    return [wheel(x, side * track_m, radius_m, width_m) for x in axles_m for side in (-1, 1)]


def bus(rng: np.random.Generator) -> Shape:
    """A city bus, 9.5 to 12 m long."""
    length, width, height = rng.uniform(9.5, 12.0), 2.5, rng.uniform(2.9, 3.2)
    half, paint = length / 2, paints.pick(paints.PAINTS, rng)
    seats = [
        box((x, y, 1.25), (0.12, 0.85, 0.7), SEAT) for x in np.arange(-half + 1, half - 2, 0.9) for y in (-0.7, 0.7)
    ]
    posts = [box((x, y, 1.75), (0.09, 0.05, 1.0), paint) for x in np.arange(-half, half, 1.5) for y in (-1.22, 1.22)]
    return join(
        [
            box((0, 0, 0.8), (length, width, 0.9), paint),
            box((0, 0, 1.75), (length - 0.06, width - 0.06, 1.0), paints.GLASS, Material.GLASS),
            box((0, 0, (2.25 + height) / 2), (length, width, height - 2.25), paint),
            box((half, 0, height - 0.3), (0.04, 1.6, 0.26), paints.RUBBER),
            *seats,
            *posts,
            *_lamps(half + 0.06, -half - 0.03, width, 0.95),
            *_wheels((half - 2.5, -half + 2.8), width / 2 - 0.16, 0.47, 0.28),
        ]
    )


def truck(rng: np.random.Generator) -> Shape:
    """A truck with a cab, a box body and a gap between them, 6.5 to 9 m long."""
    length, height = rng.uniform(6.5, 9.0), rng.uniform(2.9, 3.5)
    half, width, paint, load = length / 2, 2.4, paints.pick(paints.PAINTS, rng), paints.pick(paints.PAINTS, rng)
    cab = half - 1.8
    return join(
        [
            box(((cab + half) / 2, 0, 1.0), (1.8, 2.2, 1.0), paint),
            frustum((cab, half, 2.2, 1.5), (cab, half - 0.25, 2.1, 2.25), paints.GLASS, Material.GLASS),
            box((cab + 0.1, 0, 1.9), (0.2, 2.2, 0.8), paint),
            box(((cab + half) / 2 - 0.12, 0, 2.35), (1.6, 2.1, 0.2), paint),
            box(((cab - 0.4 - half) / 2, 0, (1.05 + height) / 2), (length - 2.2, width, height - 1.05), load),
            box((-0.2, 0, 0.85), (length - 0.6, 0.8, 0.22), paints.RUBBER),
            *_lamps(half + 0.06, -half - 0.02, 2.2, 0.8),
            *_wheels((half - 1.0, -half + 1.5), 1.0, 0.48, 0.3),
        ]
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
