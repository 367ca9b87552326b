"""Boxes, tubes, balls, rings and leaves."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls._optional import require
from ldls.simulation.shapes.paints import METAL, RUBBER
from ldls.simulation.shapes.shape import Colour, Material, Shape, join, painted

Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


@cache
def _unit(kind: str, detail: int) -> Triangles:
    """Vertices and faces of a unit solid: box (sides 1), cylinder (radius 1, z 0 to 1), ball (radius 1)."""
    creation = require("trimesh.creation", "sim")
    if kind == "box":
        mesh = creation.box()
    elif kind == "ball":
        mesh = creation.icosphere(subdivisions=detail)
    else:
        mesh = creation.cylinder(radius=1.0, segment=[[0, 0, 0], [0, 0, 1]], sections=detail)
    return np.array(mesh.vertices), np.array(mesh.faces)


@cache
def _torus(thickness: float) -> Triangles:
    mesh = require("trimesh.creation", "sim").torus(1.0, thickness, major_sections=24, minor_sections=5)
    return np.array(mesh.vertices), np.array(mesh.faces)


def box(centre_m: ArrayLike, size_m: ArrayLike, colour: Colour, material: Material = Material.PLAIN) -> Shape:
    """A box with its sides along the axes."""
    vertices, faces = _unit("box", 0)
    return painted(vertices * np.asarray(size_m) + np.asarray(centre_m), faces, colour, material)


def frustum(low_m: ArrayLike, high_m: ArrayLike, colour: Colour, material: Material = Material.PLAIN) -> Shape:
    """A box whose lid differs from its floor: each (x from, x to, width, z), the width about y = 0."""
    vertices, faces = _unit("box", 0)
    rows = np.where(vertices[:, 2:] > 0, np.asarray(high_m, np.float64), np.asarray(low_m, np.float64))
    x = np.where(vertices[:, 0] > 0, rows[:, 1], rows[:, 0])
    return painted(np.column_stack([x, vertices[:, 1] * rows[:, 2], rows[:, 3]]), faces, colour, material)


def tube(start_m: ArrayLike, end_m: ArrayLike, radius_m: float, colour: Colour, *, sides: int = 10) -> Shape:
    """A cylinder from `start_m` to `end_m`."""
    vertices, faces = _unit("cylinder", sides)
    start, along = np.asarray(start_m, np.float64), np.subtract(end_m, start_m)
    length = np.linalg.norm(along)
    z = along / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    frame = np.stack([x * radius_m, np.cross(z, x) * radius_m, along])
    return painted(vertices @ frame + start, faces, colour)


def ball(centre_m: ArrayLike, half_m: ArrayLike, colour: Colour, *, detail: int = 2) -> Shape:
    """An ellipsoid with its axes along x, y and z."""
    vertices, faces = _unit("ball", detail)
    return painted(vertices * np.asarray(half_m) + np.asarray(centre_m), faces, colour)


def ring(centre_m: ArrayLike, radius_m: float, thickness_m: float, colour: Colour) -> Shape:
    """A torus in the plane of x and z; rays pass through its middle."""
    vertices, faces = _torus(round(thickness_m / radius_m, 3))
    upright = vertices[:, [0, 2, 1]] * radius_m
    return painted(upright + np.asarray(centre_m), faces[:, ::-1], colour)


def wheel(x_m: float, y_m: float, radius_m: float, width_m: float) -> Shape:
    """A tyre and its hub, standing on the ground, its axle along y."""
    half = width_m / 2
    tyre = tube((x_m, y_m - half, radius_m), (x_m, y_m + half, radius_m), radius_m, RUBBER, sides=20)
    rim = half + 0.008
    disc = tube((x_m, y_m - rim, radius_m), (x_m, y_m + rim, radius_m), 0.6 * radius_m, METAL, sides=14)
    return join([tyre, disc])


def leaves(
    centre_m: ArrayLike, half_m: ArrayLike, count: int, leaf_m: float, green: Colour, rng: np.random.Generator
) -> Shape:
    """`count` loose triangles within an ellipsoid, denser towards its surface; rays pass between them."""
    outward = rng.normal(size=(count, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    places = outward * rng.uniform(0.3, 1.0, (count, 1)) ** 0.5 * np.asarray(half_m) + np.asarray(centre_m)
    corners = places[:, None] + rng.normal(0, 0.55 * leaf_m, (count, 3, 3))
    shape = painted(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), green, Material.LEAF)
    brightness = rng.uniform(0.7, 1.25, (count, 1)) * (0.75 + 0.35 * outward[:, 2:])
    shape.colours[...] = np.clip(shape.colours * brightness, 0, 1)
    return shape
