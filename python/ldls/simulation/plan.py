"""A scene under construction: things are put where there is room for them."""

from __future__ import annotations

from collections.abc import Container, Mapping

import numpy as np
from numpy.typing import NDArray

from ldls.simulation.ground import Ground
from ldls.simulation.scene_object import SceneObject
from ldls.simulation.shapes.shape import Shape, join

CLEAR_M = 3.2
"""Nothing stands nearer to the sensor than this."""
HEADROOM_M = 2.0
"""What of a scenery is higher above its foot is in nobody's way."""


class Plan:
    """Shapes on a ground, each a scenery or an object, none in the place of another.

    Attributes:
        ground: The ground that they stand on.
        placed: Each shape with the number of its object and the COCO id that it looks like; 0 and 0 for scenery.
        objects: Object m is `objects[m - 1]`.
    """

    def __init__(self, ground: Ground) -> None:
        self.ground = ground
        self.placed: list[tuple[int, int, Shape]] = [(0, 0, ground.shape())]
        self.objects: list[SceneObject] = []
        self._discs = np.array([[0.0, 0.0, CLEAR_M]])

    def scenery(self, shape: Shape, x_m: float, y_m: float, *, yaw: float = 0.0, room_m: float = 0.3) -> None:
        """Put a shape there, if `room_m` metres around the place are free; 0 asks for no room."""
        disc = np.array([[x_m, y_m, room_m]])
        if room_m > 0 and not self._free(disc):
            return
        if room_m > 0:
            self._discs = np.vstack([self._discs, disc])
        self.placed.append((0, 0, self._stand(shape, x_m, y_m, yaw)))

    def put(
        self,
        category: int,
        shape: Shape | Mapping[int, Shape],
        x_m: float,
        y_m: float,
        *,
        yaw: float = 0.0,
        speed_m_s: float = 0.0,
    ) -> bool:
        """Put an object there that moves along its heading; False where there is no room.

        An object of several parts has each by the COCO id that it looks like.
        """
        parts = {category: shape} if isinstance(shape, Shape) else shape
        whole = join([*parts.values()])
        discs = _footprint(whole, x_m, y_m, yaw)
        if not self._free(discs):
            return False
        self._discs = np.vstack([self._discs, discs])
        length, width, height = whole.size_m
        low, high = whole.vertices_m.min(axis=0), whole.vertices_m.max(axis=0)
        c, s = np.cos(yaw), np.sin(yaw)
        middle = (low + high) / 2
        x, y = x_m + c * middle[0] - s * middle[1], y_m + s * middle[0] + c * middle[1]
        centre = (float(x), float(y), float(self.ground.height_m(x_m, y_m)) + float(middle[2]))
        velocity = (float(speed_m_s * c), float(speed_m_s * s))
        size = (float(length), float(width), float(height))
        self.objects.append(SceneObject(category, centre, *size, float(yaw), velocity))
        self.placed += [(len(self.objects), look, self._stand(part, x_m, y_m, yaw)) for look, part in parts.items()]
        return True

    def remove(self, numbers: Container[int]) -> None:
        """Take objects away by their numbers, from 1; the others are numbered anew, in their order."""
        kept = [m for m in range(1, len(self.objects) + 1) if m not in numbers]
        new = {0: 0} | {old: m for m, old in enumerate(kept, start=1)}
        self.placed = [(new[m], look, shape) for m, look, shape in self.placed if m in new]
        self.objects = [self.objects[m - 1] for m in kept]

    def clear(self, way_m: NDArray[np.float64], room_m: float) -> None:
        """Take scenery away that stands within `room_m` metres of a place of the way (n, 2); not the ground."""
        ground, *others = self.placed
        self.placed = [ground, *(each for each in others if each[0] or _distance_m(each[2], way_m) >= room_m)]

    def _stand(self, shape: Shape, x_m: float, y_m: float, yaw: float) -> Shape:
        return shape.turned(yaw).moved((x_m, y_m, float(self.ground.height_m(x_m, y_m))))

    def _free(self, discs: NDArray[np.float64]) -> bool:
        apart = np.linalg.norm(discs[:, None, :2] - self._discs[None, :, :2], axis=-1)
        return bool((apart > discs[:, None, 2] + self._discs[None, :, 2]).all())


def _distance_m(shape: Shape, way_m: NDArray[np.float64]) -> float:
    """Least distance between the places (n, 2) and the rectangle around what of the shape is lower than a vehicle."""
    height_m = shape.vertices_m[:, 2]
    low = shape.vertices_m[height_m < height_m.min() + HEADROOM_M, :2]
    beyond = np.maximum(np.maximum(low.min(axis=0) - way_m, way_m - low.max(axis=0)), 0)
    return float(np.hypot(*beyond.T).min())


def _footprint(shape: Shape, x_m: float, y_m: float, yaw: float) -> NDArray[np.float64]:
    """(D, 3) discs (x, y, radius) that cover the shape's length."""
    length, width, _ = shape.size_m
    radius = max(min(length, width) / 2, 0.15) + 0.06
    reach = max(max(length, width) / 2 - radius, 0)
    along = np.linspace(-reach, reach, max(int(np.ceil(reach / radius)), 1) + 1)
    heading = yaw if length >= width else yaw + np.pi / 2
    centres = np.column_stack([x_m + along * np.cos(heading), y_m + along * np.sin(heading)])
    return np.column_stack([centres, np.full(len(centres), radius)])
