"""Photographs of a scene: a shaded picture, and the object of each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Floats
from ldls.simulation.raycasting import MISS, RayCaster
from ldls.simulation.rigs import MountedCamera
from ldls.simulation.scenes import Scene
from ldls.simulation.shapes.shape import Material, Shape

SUN = np.array([-0.55, -0.45, 0.70]) / np.linalg.norm([-0.55, -0.45, 0.70])
SUNLIGHT = np.array([0.92, 0.86, 0.74])
SKYLIGHT = np.array([0.42, 0.47, 0.56])
HAZE = np.array([0.78, 0.84, 0.90])
ZENITH = np.array([0.38, 0.58, 0.86])
REFLECTED_SKY = np.array([0.50, 0.58, 0.66])
PANE = np.array([0.16, 0.20, 0.25])


@dataclass(frozen=True, eq=False)
class PixelTruth:
    """The objects of an image, perfectly.

    Attributes:
        instances: (H, W) int32 object of each pixel, 0 for scenery and sky.
        categories: (H, W) int32 COCO id that each pixel looks like, 0 for scenery and sky.
        expected_px: (M,) float64 pixels that each object's box would cover with nothing before it.
    """

    instances: NDArray[np.int32]
    categories: NDArray[np.int32]
    expected_px: Floats


def photograph(
    scene: Scene, caster: RayCaster, camera: MountedCamera, height_m: float
) -> tuple[NDArray[np.uint8], PixelTruth]:
    """The image (H, W, 3) RGB and its truth, from a lidar's height in metres."""
    model, transform = camera.model, camera.T_camera_lidar()
    directions = model.directions() @ transform[:3, :3]
    origin = np.add(camera.position_m, (0, 0, height_m))
    ranges, faces = caster.first_hits(origin, directions)
    colours = _shaded(scene, caster, origin, directions, ranges, faces)
    shape = (model.height, model.width)
    owners, looks = (
        np.where(faces == MISS, 0, of_face[faces]).astype(np.int32).reshape(shape)
        for of_face in (scene.face_objects, scene.face_categories)
    )
    image = np.round(np.clip(colours, 0, 1) ** (1 / 1.15) * 255).astype(np.uint8).reshape(*shape, 3)
    return image, PixelTruth(owners, looks, _expected_px(scene, camera, height_m))


def _shaded(
    scene: Scene, caster: RayCaster, origin: Floats, directions: Floats, ranges: Floats, faces: NDArray[np.int64]
) -> Floats:
    up = np.clip(directions[:, 2:] * 2, 0, 1)
    colours: Floats = (1 - up) * HAZE + up * ZENITH
    hit = np.flatnonzero(faces != MISS)
    rays, normals = directions[hit], caster.normals[faces[hit]]
    facing = np.sign(-np.einsum("ij,ij->i", normals, rays))
    normals = normals * np.where(facing == 0, 1, facing)[:, None]
    places = origin + rays * ranges[hit, None]
    sun = np.clip(normals @ SUN, 0, 1)
    lit = np.flatnonzero(sun > 0)
    away = np.tile(SUN, (len(lit), 1))
    sun[lit] *= caster.faces(places[lit] + 0.01 * normals[lit], away) == MISS
    albedo = _textured(scene.shape, faces[hit], places, normals, rays)
    sky = SKYLIGHT * (0.75 + 0.25 * normals[:, 2:])
    fog = -np.expm1(-ranges[hit, None] / 260)
    colours[hit] = (1 - fog) * albedo * (sky + sun[:, None] * SUNLIGHT) + fog * HAZE
    return colours


def _expected_px(scene: Scene, camera: MountedCamera, height_m: float) -> Floats:
    """(M,) pixels of each object's silhouette with nothing before it: about 0.55 of the rectangle around its box."""
    transform, model = camera.T_camera_lidar(), camera.model
    areas = np.zeros(len(scene.objects))
    for m, thing in enumerate(scene.objects):
        corners = thing.below(height_m).corners_m() @ transform[:3, :3].T + transform[:3, 3]
        if (corners[:, 2] > 0.3).all():
            uv = corners[:, :2] / corners[:, 2:] * model.focal_px + np.array(model.center_px)
            areas[m] = 0.55 * np.prod(np.ptp(np.clip(uv, 0, (model.width, model.height)), axis=0))
    return areas


def _textured(shape: Shape, faces: NDArray[np.int64], places_m: Floats, normals: Floats, rays: Floats) -> Floats:
    """(R, 3) colour in [0, 1] of the triangles `faces` (R,) at `places_m` (R, 3).

    Asphalt and grass have a grain, paving has joints, houses have windows, and glass reflects the sky.
    """
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
    paving = materials == Material.PAVING
    joints = (np.mod(places_m[paving, :2], 0.6) < 0.02).any(axis=1)
    colours[paving] *= np.where(joints, 0.75, 1.0)[:, None]
    _windows(colours, materials == Material.FACADE, places_m, normals)
    glass = materials == Material.GLASS
    grazing = (1 - np.abs(np.einsum("ij,ij->i", normals[glass], rays[glass]))) ** 2
    colours[glass] += grazing[:, None] * (REFLECTED_SKY - colours[glass])
    return colours


def _grain(places_m: Floats, cell_m: float) -> Floats:
    """A number in [0, 1) for each cell of space, the same every time."""
    cells = np.floor(places_m / cell_m).astype(np.int64)
    mixed = cells @ np.array([73856093, 19349663, 83492791])
    mixed = (mixed ^ (mixed >> 13)) * 1274126177
    grain: Floats = ((mixed >> 8) & 0xFFFF) / 65536.0
    return grain


def _windows(colours: Floats, there: NDArray[np.bool_], places_m: Floats, normals: Floats) -> None:
    """Paint panes 1.1 m wide and 1.5 m tall, 3.2 m from floor to floor."""
    rows = np.flatnonzero(there)
    places, upright = places_m[rows], np.abs(normals[rows, 2]) < 0.5
    along = np.where(np.abs(normals[rows, 1]) > 0.5, places[:, 0], places[:, 1])
    across, up = np.mod(along, 2.4), np.mod(places[:, 2], 3.2)
    frame = (across > 0.6) & (across < 1.9) & (up > 0.95) & (up < 2.65) & upright
    pane = (across > 0.7) & (across < 1.8) & (up > 1.05) & (up < 2.55) & upright & (np.abs(across - 1.25) > 0.03)
    colours[rows[frame]] = 0.85
    colours[rows[pane]] = PANE * (1 + _grain(places[pane], 2.4))[:, None]
