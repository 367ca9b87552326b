"""A scene: one mesh, and which object each of its triangles belongs to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls.checks import choice
from ldls.simulation.layouts import LAYOUTS
from ldls.simulation.plan import Plan
from ldls.simulation.scene_object import SceneObject
from ldls.simulation.shapes.shape import Shape, join


@dataclass(frozen=True, eq=False)
class Scene:
    """F triangles and the objects that they are of.

    The frame has x ahead of the sensor, y left, z up; its origin is on the ground below the sensor.

    Attributes:
        shape: The mesh.
        face_objects: (F,) int32 object of each triangle; 0 is scenery.
        face_categories: (F,) int32 COCO id that each triangle looks like; 0 is scenery.
        objects: Object m is `objects[m - 1]`.
    """

    shape: Shape
    face_objects: NDArray[np.int32]
    face_categories: NDArray[np.int32]
    objects: tuple[SceneObject, ...]

    def after(self, seconds: float) -> Scene:
        """The scene `seconds` later, its objects moved on."""
        if seconds == 0:
            return self
        by_m = np.zeros((len(self.objects) + 1, 3))
        by_m[1:, :2] = [np.multiply(o.velocity_m_s, seconds) for o in self.objects]
        return self.moved(by_m)

    def moved(self, by_m: NDArray[np.float64]) -> Scene:
        """The scene with its scenery moved by the first of the rows (M + 1, 3), in metres, each object by its own."""
        vertex_objects = np.zeros(len(self.shape.vertices_m), np.int32)
        vertex_objects[self.shape.faces] = self.face_objects[:, None]
        shape = replace(self.shape, vertices_m=self.shape.vertices_m + by_m[vertex_objects])
        objects = tuple(o.moved((x, y, z)) for o, (x, y, z) in zip(self.objects, by_m[1:].tolist(), strict=True))
        return replace(self, shape=shape, objects=objects)

    def turned(self, yaw: float) -> Scene:
        """The scene turned about z, to the left, by radians."""
        return replace(self, shape=self.shape.turned(yaw), objects=tuple(each.turned(yaw) for each in self.objects))


def make_scene(seed: int = 0, *, kind: str = "street") -> Scene:
    """A scene of a kind, `street` or `campus`; each seed is another one.

    Raises:
        ParameterError: There is no such kind.
        ImportError: `ldls[sim]` is not installed.
    """
    return build(make_plan(seed, kind=kind))


def make_plan(seed: int, *, kind: str) -> Plan:
    """The plan of the scene of a seed.

    Raises:
        ParameterError: There is no such kind.
    """
    return LAYOUTS[choice("kind", kind, LAYOUTS)](np.random.default_rng(seed))


def build(plan: Plan) -> Scene:
    """The scene of a plan."""
    numbers, looks, shapes = zip(*plan.placed, strict=True)
    counts = [len(shape.faces) for shape in shapes]
    return Scene(
        shape=join(shapes),
        face_objects=np.repeat(np.array(numbers, np.int32), counts),
        face_categories=np.repeat(np.array(looks, np.int32), counts),
        objects=tuple(plan.objects),
    )
