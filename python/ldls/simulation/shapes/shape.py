"""A shape: triangles, with the colour and the material of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

Colour = tuple[float, float, float]


class Material(IntEnum):
    """Look of a surface, and its effect on a laser."""

    PLAIN = 0
    GLASS = 1
    LEAF = 2
    ASPHALT = 3
    PAVING = 4
    FACADE = 5
    GRASS = 6
    REFLECTOR = 7


@dataclass(frozen=True, eq=False)
class Shape:
    """F triangles over V vertices.

    Attributes:
        vertices_m: (V, 3) float64 coordinates in metres.
        faces: (F, 3) int64 indices of vertices.
        colours: (F, 3) float32 RGB in [0, 1].
        materials: (F,) int8 values of `Material`.
    """

    vertices_m: NDArray[np.float64]
    faces: NDArray[np.int64]
    colours: NDArray[np.float32]
    materials: NDArray[np.int8]

    @property
    def size_m(self) -> NDArray[np.float64]:
        """(3,) extent along x, y and z, in metres."""
        extent: NDArray[np.float64] = np.ptp(self.vertices_m, axis=0)
        return extent

    def scaled(self, factors: ArrayLike) -> Shape:
        """The shape stretched about its origin."""
        return replace(self, vertices_m=self.vertices_m * np.asarray(factors, np.float64))

    def moved(self, by_m: ArrayLike) -> Shape:
        """The shape displaced by (3,) metres."""
        return replace(self, vertices_m=self.vertices_m + np.asarray(by_m, np.float64))

    def turned(self, yaw: float) -> Shape:
        """The shape turned about z, to the left, by radians."""
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        return replace(self, vertices_m=self.vertices_m @ turn.T)

    def part(self, faces: NDArray[np.int64]) -> Shape:
        """The triangles of these numbers, with no vertices but theirs."""
        used, corners = np.unique(self.faces[faces], return_inverse=True)
        return Shape(self.vertices_m[used], corners.reshape(-1, 3), self.colours[faces], self.materials[faces])


def painted(
    vertices_m: ArrayLike, faces: ArrayLike, colour: Sequence[float], material: Material = Material.PLAIN
) -> Shape:
    """A shape of one colour and one material."""
    triangles = np.asarray(faces, np.int64)
    return Shape(
        vertices_m=np.asarray(vertices_m, np.float64),
        faces=triangles,
        colours=np.tile(np.asarray(colour, np.float32), (len(triangles), 1)),
        materials=np.full(len(triangles), material, np.int8),
    )


def join(shapes: Sequence[Shape]) -> Shape:
    """All `shapes` as one."""
    offsets = np.cumsum([0, *(len(s.vertices_m) for s in shapes)])
    return Shape(
        vertices_m=np.concatenate([s.vertices_m for s in shapes]),
        faces=np.concatenate([s.faces + offset for s, offset in zip(shapes, offsets, strict=False)]),
        colours=np.concatenate([s.colours for s in shapes]),
        materials=np.concatenate([s.materials for s in shapes]),
    )
