"""People, on foot and on bicycles, and dogs, with the gaps between their legs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ldls.cloud import Floats
from ldls.simulation.shapes import paints
from ldls.simulation.shapes.primitives import ball, box, tube
from ldls.simulation.shapes.shape import Colour, Shape, join

HIPS_M = (-0.2, 0.0, 1.04)
"""Where the hips of a rider are, on a bicycle that is `BICYCLE_HEIGHT_M` high."""
BICYCLE_HEIGHT_M = 1.056


def person(rng: np.random.Generator, *, walking: bool = True) -> Shape:
    """A person, 1.5 to 1.95 m tall, in a step or standing with the feet apart."""
    shirt, trousers = paints.pick(paints.SHIRTS, rng), paints.pick(paints.TROUSERS, rng)
    skin = paints.pick(paints.SKINS, rng)
    stride = float(rng.uniform(0.14, 0.34)) if walking else float(rng.uniform(0.0, 0.06))
    parts = [*_torso(shirt, trousers), *_head(skin)]
    for side in (-1, 1):
        swing = side * stride
        parts += [*_leg(side, swing, trousers), *_arm(side, -0.8 * swing, shirt, skin)]
    if rng.random() < 0.3:
        parts.append(box((-0.2, 0, 1.22), (0.18, 0.3, 0.42), paints.pick(paints.PAINTS, rng)))
    tall = rng.uniform(0.87, 1.12)
    stout = tall * rng.uniform(0.95, 1.2)
    return join(parts).scaled((stout, stout, tall))


def rider(bicycle: Shape, rng: np.random.Generator) -> Shape:
    """A person astride `bicycle`, of `vehicles.bicycle`: hands on its handlebar, feet where its pedals would be."""
    shirt, trousers = paints.pick(paints.SHIRTS, rng), paints.pick(paints.TROUSERS, rng)
    skin, crank, lean = paints.pick(paints.SKINS, rng), rng.uniform(0, 2 * np.pi), float(rng.uniform(0.35, 0.6))
    parts = [_leaning(join([*_torso(shirt, trousers), *_head(skin)]), lean)]
    for side in (-1, 1):
        parts += _pedalling(side, crank if side < 0 else crank + np.pi, trousers)
        shoulder = np.add(HIPS_M, (0.48 * np.sin(lean), 0.22 * side, 0.48 * np.cos(lean)))
        parts += _reaching(shoulder, np.array([0.33, 0.24 * side, 1.06]), shirt, skin)
    return join(parts).scaled(bicycle.size_m[2] / BICYCLE_HEIGHT_M)


def _leaning(upright: Shape, lean: float) -> Shape:
    """A torso and head turned forward by `lean` radians about the hips, on the saddle."""
    c, s = np.cos(lean), np.sin(lean)
    about = upright.moved((0, 0, -0.93)).vertices_m
    return replace(upright, vertices_m=about @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) + np.array(HIPS_M))


def _pedalling(side: int, crank: float, trousers: Colour) -> list[Shape]:
    """A leg whose foot is at the angle `crank` of a circle of 0.17 m about the bottom bracket."""
    hip = np.add(HIPS_M, (0, 0.095 * side, 0))
    ankle = np.array([-0.09 + 0.17 * np.cos(crank), 0.12 * side, 0.39 + 0.17 * np.sin(crank)])
    knee = _joint(hip, ankle, 0.46)
    return [
        tube(hip, knee, 0.078, trousers),
        tube(knee, ankle, 0.056, trousers),
        ball(np.add(ankle, (0.07, 0, -0.05)), (0.14, 0.05, 0.045), paints.RUBBER, detail=1),
    ]


def _reaching(shoulder: Floats, hand: Floats, shirt: Colour, skin: Colour) -> list[Shape]:
    elbow = _joint(hand, shoulder, 0.3)
    return [
        tube(shoulder, elbow, 0.048, shirt, sides=8),
        tube(elbow, hand, 0.038, shirt, sides=8),
        ball(hand, (0.045, 0.03, 0.06), skin, detail=1),
    ]


def _joint(upper: Floats, lower: Floats, bone_m: float) -> Floats:
    """Where two bones of `bone_m` meet between two ends, bent forward (x) as seen from `upper` down to `lower`."""
    along = lower - upper
    length = float(np.linalg.norm(along))
    forward = np.cross(along, (0.0, 1.0, 0.0)) / length
    bend: Floats = (upper + lower) / 2 + forward * np.sqrt(max(bone_m**2 - length**2 / 4, 0.0))
    return bend


def _torso(shirt: Colour, trousers: Colour) -> list[Shape]:
    return [
        ball((0, 0, 0.93), (0.13, 0.175, 0.14), trousers),
        ball((0, 0, 1.16), (0.125, 0.18, 0.3), shirt),
        ball((0, 0, 1.36), (0.12, 0.215, 0.13), shirt),
    ]


def _head(skin: Colour) -> list[Shape]:
    return [
        tube((0.01, 0, 1.42), (0.01, 0, 1.56), 0.055, skin),
        ball((0.02, 0, 1.62), (0.095, 0.08, 0.125), skin),
        ball((-0.015, 0, 1.66), (0.10, 0.09, 0.11), paints.HAIR),
    ]


def _leg(side: int, swing: float, trousers: Colour) -> list[Shape]:
    """A leg bent a little at the knee, its hip 0.09 m off the middle."""
    y, knee = side * 0.095, 0.5 * swing + 0.05
    return [
        tube((0, y, 0.9), (knee, y, 0.5), 0.078, trousers),
        tube((knee, y, 0.5), (swing, y, 0.07), 0.056, trousers),
        ball((swing + 0.06, y, 0.045), (0.14, 0.05, 0.045), paints.RUBBER, detail=1),
    ]


def _arm(side: int, swing: float, shirt: Colour, skin: Colour) -> list[Shape]:
    y, elbow = side * 0.245, (0.3 * swing - 0.03, side * 0.265, 1.13)
    hand = (swing + 0.05, side * 0.255, 0.87)
    return [
        tube((0, y * 0.9, 1.41), elbow, 0.048, shirt, sides=8),
        tube(elbow, hand, 0.038, shirt, sides=8),
        ball(hand, (0.045, 0.03, 0.06), skin, detail=1),
    ]


def dog(rng: np.random.Generator) -> Shape:
    """A dog, 0.4 to 0.65 m at the shoulder."""
    coat = paints.pick(paints.COATS, rng)
    steps = ((0.3, 0.1, 0.1), (0.3, -0.1, -0.06), (-0.3, 0.1, -0.1), (-0.3, -0.1, 0.08))
    return join(
        [
            *(tube((x + dx, y, 0), (x, y, 0.45), 0.038, coat, sides=8) for x, y, dx in steps),
            ball((0.0, 0, 0.50), (0.43, 0.14, 0.15), coat),
            ball((0.27, 0, 0.52), (0.19, 0.15, 0.18), coat),
            tube((0.34, 0, 0.58), (0.52, 0, 0.78), 0.085, coat),
            ball((0.54, 0, 0.80), (0.13, 0.09, 0.10), coat),
            box((0.67, 0, 0.76), (0.15, 0.08, 0.075), coat),
            ball((0.75, 0, 0.78), (0.02, 0.03, 0.02), paints.RUBBER, detail=1),
            *(ball((0.48, y, 0.82), (0.05, 0.025, 0.09), paints.HAIR, detail=1) for y in (-0.09, 0.09)),
            tube((-0.40, 0, 0.56), (-0.64, 0, 0.74), 0.028, coat, sides=6),
        ]
    ).scaled(rng.uniform(0.65, 1.0))
