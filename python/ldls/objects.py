"""One record for each segmented instance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class OrientedBox:
    """An upright box in the lidar frame.

    Attributes:
        center: (3,) x y z of its middle, in metres.
        size: (3,) length, width, height in metres; the length is the longer side on the ground.
        yaw: Angle in radians from the x axis to the length, anticlockwise, in (-pi/2, pi/2].
    """

    center: NDArray[np.float64]
    size: NDArray[np.float64]
    yaw: float


@dataclass(frozen=True, kw_only=True)
class SegmentedObject:
    """What became of one instance mask.

    Attributes:
        label: Its label m in `Segmentation.labels`.
        category: Category id.
        name: Category name.
        score: Score of the 2D segmenter.
        n_points: Points that carry its label.
        centroid: (3,) mean of these points in metres; None without points.
        box: The upright box of least ground area that holds them; None without points.
    """

    label: int
    category: int
    name: str
    score: float
    n_points: int
    centroid: NDArray[np.float64] | None
    box: OrientedBox | None

    @property
    def distance_m(self) -> float | None:
        """Distance of the centroid from the lidar along the ground, in metres; None without points."""
        return None if self.centroid is None else float(np.hypot(*self.centroid[:2]))


def fit_upright_box(points: NDArray[np.float64]) -> OrientedBox:
    """The upright box of least ground area, to one degree of heading, around (n, 3) points in metres."""
    # a rectangle comes round to itself after a quarter turn
    headings = np.deg2rad(np.arange(90.0))
    along = np.stack([np.cos(headings), np.sin(headings)])
    across = np.stack([-np.sin(headings), np.cos(headings)])
    ground = points[:, :2]
    low = np.stack([(ground @ axis).min(axis=0) for axis in (along, across)])
    high = np.stack([(ground @ axis).max(axis=0) for axis in (along, across)])
    best = int(np.argmin((high - low).prod(axis=0)))
    middle = (low + high)[:, best] / 2
    length, width = (high - low)[:, best]
    yaw = float(headings[best])
    if width > length:
        length, width, yaw = width, length, yaw - np.pi / 2
        yaw = yaw + np.pi if yaw <= -np.pi / 2 else yaw
    bottom, top = points[:, 2].min(), points[:, 2].max()
    x, y = along[:, best] * middle[0] + across[:, best] * middle[1]
    return OrientedBox(
        center=np.array([x, y, (bottom + top) / 2]),
        size=np.array([length, width, top - bottom]),
        yaw=yaw,
    )
