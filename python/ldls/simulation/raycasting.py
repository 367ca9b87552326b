"""The first triangle that each ray meets, by Intel Embree."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.cloud import Floats
from ldls.simulation.shapes.shape import Shape

MISS = -1


class RayCaster:
    """Casts rays at a shape.

    Embree finds the triangle in single precision; the distance to the triangle's plane is worked out here in double
    precision, so ranges are good to well under a millimetre.

    Attributes:
        normals: (F, 3) unit normals of the triangles.
    """

    def __init__(self, shape: Shape) -> None:
        """A caster for `shape`.

        Raises:
            ImportError: `ldls[sim]` is not installed.
        """
        require("embreex", "sim")
        trimesh, embree = require("trimesh", "sim"), require("trimesh.ray.ray_pyembree", "sim")
        mesh = trimesh.Trimesh(shape.vertices_m, shape.faces, process=False, validate=False)
        self._intersector: Any = embree.RayMeshIntersector(mesh, scale_to_box=False)
        a, b, c = (shape.vertices_m[shape.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        self.normals: Floats = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        self._offsets: Floats = np.einsum("ij,ij->i", self.normals, a)

    def faces(self, origins_m: Floats, directions: Floats) -> NDArray[np.int64]:
        """(R,) first triangle of each ray, -1 where it meets none; `origins_m` is (3,) or (R, 3)."""
        origins = np.broadcast_to(origins_m, directions.shape)
        return np.asarray(self._intersector.intersects_first(origins, directions), np.int64)

    def first_hits(self, origins_m: Floats, directions: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """(R,) range in metres (infinity for a miss) and (R,) triangle (-1) of each ray of unit length."""
        faces = self.faces(origins_m, directions)
        ranges = np.full(len(faces), np.inf)
        hit = np.flatnonzero(faces != MISS)
        normals = self.normals[faces[hit]]
        origins = np.broadcast_to(origins_m, directions.shape)[hit]
        towards = np.einsum("ij,ij->i", normals, directions[hit])
        gap = self._offsets[faces[hit]] - np.einsum("ij,ij->i", normals, origins)
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges[hit] = gap / towards
        ranges[~(ranges > 0)] = np.inf  # a ray within its triangle's plane
        faces[~np.isfinite(ranges)] = MISS
        return ranges, faces
