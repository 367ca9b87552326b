"""The ground of a scene: slope, undulation, and a kerb on either side of the road."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.simulation.shapes.shape import Colour, Material, Shape, join, painted

NEAR_M, FAR_M, STEP_M = -60.0, 110.0, 5.0


@dataclass(frozen=True)
class Strip:
    """A strip of ground along x, from y `right_m` to `left_m`, `up_m` above the road."""

    right_m: float
    left_m: float
    up_m: float
    colour: Colour
    material: Material


@dataclass(frozen=True)
class Ground:
    """Strips side by side, from right to left, on a gently rolling slope; its height is 0 at the origin.

    Attributes:
        strips: From the right to the left, each beginning where the last one ends.
        slope: Rise a metre along x and along y.
        roll_m: Amplitude of the undulation along x, in metres.
        phase: Where the undulation begins, in radians.
    """

    strips: tuple[Strip, ...]
    slope: tuple[float, float]
    roll_m: float
    phase: float

    def height_m(self, x_m: ArrayLike, y_m: ArrayLike) -> NDArray[np.float64]:
        """Height of the surface at places, in metres; of the shape of x and y together."""
        x, y = np.asarray(x_m, np.float64), np.asarray(y_m, np.float64)
        strip = np.searchsorted([s.left_m for s in self.strips[:-1]], y, side="right")
        height: NDArray[np.float64] = self._base(x, y) + np.array([s.up_m for s in self.strips])[strip]
        return height

    def shape(self) -> Shape:
        """The surface, with the upright faces of its kerbs."""
        x = np.arange(NEAR_M, FAR_M + STEP_M, STEP_M)
        parts = []
        for strip in self.strips:
            y = np.linspace(strip.right_m, strip.left_m, 3)
            parts.append(self._sheet(x, y, np.full(3, strip.up_m), strip.colour, strip.material))
        for right, left in zip(self.strips, self.strips[1:], strict=False):
            edge, stone = np.full(2, right.left_m), (0.6, 0.59, 0.57)
            parts.append(self._sheet(x, edge, np.array([right.up_m, left.up_m]), stone, Material.PLAIN))
        return join(parts)

    def _base(self, x_m: NDArray[np.float64], y_m: NDArray[np.float64]) -> NDArray[np.float64]:
        wave = self.roll_m * (np.sin(x_m / 14 + self.phase) - np.sin(self.phase))
        height: NDArray[np.float64] = self.slope[0] * x_m + self.slope[1] * y_m + wave
        return height

    def _sheet(
        self,
        x_m: NDArray[np.float64],
        y_m: NDArray[np.float64],
        up_m: NDArray[np.float64],
        colour: Colour,
        material: Material,
    ) -> Shape:
        x, y = np.meshgrid(x_m, y_m, indexing="ij")
        vertices = np.stack([x, y, self._base(x, y) + up_m], axis=-1).reshape(-1, 3)
        first = (np.arange(len(x_m) - 1)[:, None] * len(y_m) + np.arange(len(y_m) - 1)).ravel()
        a, b, c, d = first, first + len(y_m), first + len(y_m) + 1, first + 1
        faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
        return painted(vertices, faces, colour, material)
