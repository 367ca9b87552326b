"""The colour of a surface at a place: grain of asphalt and grass, joints of paving, windows of houses, glass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.simulation.shapes.shape import Material, Shape

REFLECTED_SKY = np.array([0.50, 0.58, 0.66])
PANE = np.array([0.16, 0.20, 0.25])
F64 = NDArray[np.float64]


def textured(shape: Shape, faces: NDArray[np.int64], places_m: F64, normals: F64, rays: F64) -> F64:
    """(R, 3) colour in [0, 1] of the triangles `faces` (R,) at `places_m` (R, 3)."""
    colours = shape.colours[faces].astype(np.float64)
    materials = shape.materials[faces]
    for material, cell_m, strength in (
        (Material.ASPHALT, 0.07, 0.10),
        (Material.GRASS, 0.05, 0.35),
        (Material.PAVING, 0.6, 0.08),
        (Material.FACADE, 1.3, 0.05),
    ):
        there = materials == material
        colours[there] *= 1 + strength * (_grain(places_m[there], cell_m) - 0.5)[:, None]
    _joints(colours, materials == Material.PAVING, places_m)
    _windows(colours, materials == Material.FACADE, places_m, normals)
    glass = materials == Material.GLASS
    grazing = (1 - np.abs(np.einsum("ij,ij->i", normals[glass], rays[glass]))) ** 2
    colours[glass] += grazing[:, None] * (REFLECTED_SKY - colours[glass])
    return colours


def _grain(places_m: F64, cell_m: float) -> F64:
    """A number in [0, 1) for each cell of space, always the same."""
    cells = np.floor(places_m / cell_m).astype(np.int64)
    mixed = cells @ np.array([73856093, 19349663, 83492791])
    mixed = (mixed ^ (mixed >> 13)) * 1274126177
    grain: F64 = ((mixed >> 8) & 0xFFFF) / 65536.0
    return grain


def _joints(colours: F64, there: NDArray[np.bool_], places_m: F64) -> None:
    phase = np.mod(places_m[there, :2], 0.6)
    colours[there] *= np.where((phase < 0.02).any(axis=1), 0.75, 1.0)[:, None]


def _windows(colours: F64, there: NDArray[np.bool_], places_m: F64, normals: F64) -> None:
    """Paint panes 1.1 m wide and 1.5 m tall, 3.2 m from floor to floor."""
    rows = np.flatnonzero(there)
    places, upright = places_m[rows], np.abs(normals[rows, 2]) < 0.5
    along = np.where(np.abs(normals[rows, 1]) > 0.5, places[:, 0], places[:, 1])
    across, up = np.mod(along, 2.4), np.mod(places[:, 2], 3.2)
    frame = (across > 0.6) & (across < 1.9) & (up > 0.95) & (up < 2.65) & upright
    pane = (across > 0.7) & (across < 1.8) & (up > 1.05) & (up < 2.55) & upright & (np.abs(across - 1.25) > 0.03)
    colours[rows[frame]] = 0.85
    colours[rows[pane]] = PANE * (1 + _grain(places[pane], 2.4))[:, None]
