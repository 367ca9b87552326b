"""What a camera sees in a scene: a shaded picture, and the object of each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.simulation.cameras import MountedCamera
from ldls.simulation.raycasting import MISS, RayCaster
from ldls.simulation.scenes import Scene
from ldls.simulation.surfaces import textured

SUN = np.array([-0.55, -0.45, 0.70]) / np.linalg.norm([-0.55, -0.45, 0.70])
SUNLIGHT = np.array([0.92, 0.86, 0.74])
SKYLIGHT = np.array([0.42, 0.47, 0.56])
HAZE = np.array([0.78, 0.84, 0.90])
ZENITH = np.array([0.38, 0.58, 0.86])
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PixelTruth:
    """The objects of an image, perfectly.

    Attributes:
        instances: (H, W) int32 object of each pixel, 0 for scenery and sky.
        categories: (M,) int32 COCO id of each object m, at m - 1.
        expected_px: (M,) float64 pixels that each object's box would cover with nothing before it.
    """

    instances: NDArray[np.int32]
    categories: NDArray[np.int32]
    expected_px: F64


def photograph(
    scene: Scene, caster: RayCaster, camera: MountedCamera, height_m: float
) -> tuple[NDArray[np.uint8], PixelTruth]:
    """The image (H, W, 3) RGB and its truth, from a lidar's height in metres."""
    model, transform = camera.model, camera.T_camera_lidar()
    directions = model.directions() @ transform[:3, :3]
    origin = np.add(camera.position_m, (0, 0, height_m))
    ranges, faces = caster.first_hits(origin, directions)
    colours = _shaded(scene, caster, origin, directions, ranges, faces)
    owners = np.where(faces == MISS, 0, scene.face_objects[faces]).astype(np.int32)
    shape = (model.height, model.width)
    image = np.round(np.clip(colours, 0, 1) ** (1 / 1.15) * 255).astype(np.uint8).reshape(*shape, 3)
    return image, PixelTruth(owners.reshape(shape), scene.categories, _expected_px(scene, camera, height_m))


def _shaded(
    scene: Scene, caster: RayCaster, origin: F64, directions: F64, ranges: F64, faces: NDArray[np.int64]
) -> F64:
    colours = _sky(directions)
    hit = np.flatnonzero(faces != MISS)
    rays, normals = directions[hit], caster.normals[faces[hit]]
    facing = np.sign(-np.einsum("ij,ij->i", normals, rays))
    normals = normals * np.where(facing == 0, 1, facing)[:, None]
    places = origin + rays * ranges[hit, None]
    sun = np.clip(normals @ SUN, 0, 1)
    lit = np.flatnonzero(sun > 0)
    away = np.tile(SUN, (len(lit), 1))
    sun[lit] *= caster.faces(places[lit] + 0.01 * normals[lit], away) == MISS
    albedo = textured(scene.shape, faces[hit], places, normals, rays)
    sky = SKYLIGHT * (0.75 + 0.25 * normals[:, 2:])
    fog = -np.expm1(-ranges[hit, None] / 260)
    colours[hit] = (1 - fog) * albedo * (sky + sun[:, None] * SUNLIGHT) + fog * HAZE
    return colours


def _sky(directions: F64) -> F64:
    up = np.clip(directions[:, 2:] * 2, 0, 1)
    sky: F64 = (1 - up) * HAZE + up * ZENITH
    return sky


def _expected_px(scene: Scene, camera: MountedCamera, height_m: float) -> F64:
    """(M,) pixels of each object's silhouette if nothing hid it: about 0.55 of the rectangle around its box."""
    transform, model = camera.T_camera_lidar(), camera.model
    areas = np.zeros(len(scene.objects))
    for m, thing in enumerate(scene.objects):
        corners = thing.below(height_m).corners_m() @ transform[:3, :3].T + transform[:3, 3]
        if (corners[:, 2] > 0.3).all():
            uv = corners[:, :2] / corners[:, 2:] * model.focal_px + np.array(model.center_px)
            low, high = (
                np.clip(uv, 0, (model.width, model.height)).min(0),
                np.clip(uv, 0, (model.width, model.height)).max(0),
            )
            areas[m] = 0.55 * np.prod(high - low)
    return areas
