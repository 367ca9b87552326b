"""A scene: one mesh, and which object each of its triangles belongs to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls.errors import ParameterError
from ldls.simulation.layouts import LAYOUTS
from ldls.simulation.objects import SceneObject
from ldls.simulation.plan import Plan
from ldls.simulation.shapes.shape import Shape, join


@dataclass(frozen=True, eq=False)
class Scene:
    """F triangles and the objects that they are of.

    The frame has x ahead of the sensor, y left, z up; its origin is on the ground below the sensor.

    Attributes:
        shape: The mesh.
        face_objects: (F,) int32 object of each triangle; 0 is scenery.
        objects: Object m is `objects[m - 1]`.
    """

    shape: Shape
    face_objects: NDArray[np.int32]
    objects: tuple[SceneObject, ...]

    @property
    def categories(self) -> NDArray[np.int32]:
        """(M,) COCO ids of the objects."""
        return np.array([o.category for o in self.objects], np.int32)

    def after(self, seconds: float) -> Scene:
        """The scene `seconds` later, its objects moved on."""
        if seconds == 0:
            return self
        by_m = np.zeros((len(self.objects) + 1, 3))
        by_m[1:, :2] = [o.velocity_m_s for o in self.objects]
        vertex_objects = np.zeros(len(self.shape.vertices_m), np.int32)
        vertex_objects[self.shape.faces] = self.face_objects[:, None]
        moved = self.shape.vertices_m + seconds * by_m[vertex_objects]
        objects = tuple(o.after(seconds) for o in self.objects)
        return replace(self, shape=replace(self.shape, vertices_m=moved), objects=objects)


def make_scene(seed: int = 0, *, kind: str = "street") -> Scene:
    """A scene of a kind, `street` or `campus`; each seed is another one.

    Raises:
        ParameterError: There is no such kind.
        ImportError: `ldls[sim]` is not installed.
    """
    if kind not in LAYOUTS:
        raise ParameterError(f"kind: got {kind!r}, expected one of {', '.join(LAYOUTS)}")
    return _built(LAYOUTS[kind](np.random.default_rng(seed)))


def _built(plan: Plan) -> Scene:
    faces = [np.full(len(shape.faces), number, np.int32) for number, shape in plan.placed]
    return Scene(
        shape=join([shape for _, shape in plan.placed]),
        face_objects=np.concatenate(faces),
        objects=tuple(plan.objects),
    )
