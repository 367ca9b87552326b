"""Rays of many moments in a scene whose objects move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldls.cloud import Floats, Ints
from ldls.simulation.raycasting import MISS, RayCaster
from ldls.simulation.scenes import Scene


class MovingCaster:
    """Casts rays at a scene whose objects move, each ray at what is where at its own moment.

    What stands still has one caster, and each object that moves its own: a ray is moved back by the way of the object
    rather than the object forth, so that no mesh is built twice.

    Attributes:
        normals: (F, 3) unit normals of the triangles of the scene.
    """

    def __init__(self, scene: Scene, ways_m: Floats) -> None:
        """A caster for `scene`, whose M objects have gone `ways_m` (M, n, 3) metres at each of n moments.

        Raises:
            ImportError: `ldls[sim]` is not installed.
        """
        moving = np.flatnonzero(ways_m.any(axis=(1, 2))) + 1
        still = np.zeros(ways_m.shape[1:])
        chosen = [(~np.isin(scene.face_objects, moving), still)]
        chosen += [(scene.face_objects == number, ways_m[number - 1]) for number in moving]
        self.normals: Floats = np.zeros((len(scene.face_objects), 3))
        self._parts: list[_Part] = []
        for there, way_m in chosen:
            faces = np.flatnonzero(there)
            if len(faces):  # Embree has no empty meshes
                shape = scene.shape.part(faces)
                centre = (shape.vertices_m.min(axis=0) + shape.vertices_m.max(axis=0)) / 2
                radius = float(np.linalg.norm(shape.vertices_m - centre, axis=1).max()) + 1e-3
                caster = RayCaster(shape)
                self.normals[faces] = caster.normals
                self._parts.append(_Part(caster, faces, centre, radius, way_m))

    def first_hits(self, origins_m: Floats, directions: Floats, moments: Ints) -> tuple[Floats, Ints]:
        """(R,) range in metres (infinity for a miss) and (R,) triangle (-1) of each ray of unit length.

        Args:
            origins_m: (R, 3) where the rays begin.
            directions: (R, 3) unit vectors.
            moments: (R,) number of the moment of each ray.
        """
        ranges, faces = np.full(len(directions), np.inf), np.full(len(directions), MISS, np.int64)
        for part in self._parts:
            origins = origins_m - part.way_m[moments]
            near = part.near(origins, directions)
            found_m, found = part.caster.first_hits(origins[near], directions[near])
            first = found_m < ranges[near]
            rays = near[first]
            ranges[rays], faces[rays] = found_m[first], part.faces[found[first]]
        return ranges, faces


@dataclass(frozen=True, eq=False)
class _Part:
    """What moves as one: its triangles, their numbers in the scene, the sphere around them, and its way (n, 3)."""

    caster: RayCaster
    faces: Ints
    centre_m: Floats
    radius_m: float
    way_m: Floats

    def near(self, origins_m: Floats, directions: Floats) -> Ints:
        """Numbers of the rays that meet the sphere, for few of them meet a small object."""
        towards = self.centre_m - origins_m
        along = np.einsum("ij,ij->i", towards, directions)
        aside = np.einsum("ij,ij->i", towards, towards) - along**2
        return np.flatnonzero((aside <= self.radius_m**2) & (along >= -self.radius_m))
