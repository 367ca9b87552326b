"""Upright boxes, and the one that fits points of which a lidar sees one side or two."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

NEAR_M = 0.1
"""Distance from a side up to which points count the same: sides bulge, and ranges are noisy."""
AS_GOOD = 0.998
"""Share of the best closeness from which on area decides."""
STRAY = 0.04
"""Share of the points at either end that do not decide where a side is."""
MOST_LOOKED_AT = 150
"""Points of an object, evenly chosen, that decide on its heading."""


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

    def corners(self) -> NDArray[np.float64]:
        """(8, 3) float64 x y z of its corners in metres, in the lidar frame.

        The four at the bottom come first, anticlockwise as seen from above, then the four above them in the same order:
        front left, rear left, rear right, front right. Front is where `yaw` points, for points do not tell which end of
        an object is which.
        """
        half = np.array([[1, 1, -1], [-1, 1, -1], [-1, -1, -1], [1, -1, -1]]) / 2
        along, across, up = (np.vstack([half, half * (1, 1, -1)]) * self.size).T
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        offsets = np.stack([cos * along - sin * across, sin * along + cos * across, up], axis=1)
        return np.asarray(self.center + offsets, np.float64)


def fit_upright_box(points: NDArray[np.float64]) -> OrientedBox:
    """The upright box around (n, 3) points in metres whose sides run along the sides that the lidar saw.

    Of 90 headings, one degree apart, it has the one at which points lie nearest to two sides that meet (closeness, of
    Zhang et al., Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners, IV 2017), and of those as good
    as that, the one of least area. Stray points do not decide where sides are; the box holds all points.
    """
    # a rectangle comes round to itself after a quarter turn
    headings = np.deg2rad(np.arange(90.0))
    some = points[:: ceil(len(points) / MOST_LOOKED_AT), :2]
    heading = float(headings[_best(some, headings)])
    along, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    ground = points[:, :2] @ np.stack([along, across], axis=1)
    low, high = ground.min(axis=0), ground.max(axis=0)
    middle = (low + high) / 2
    length, width = high - low
    yaw = heading
    if width > length:
        length, width, yaw = width, length, heading - np.pi / 2
        yaw = yaw + np.pi if yaw <= -np.pi / 2 else yaw
    bottom, top = points[:, 2].min(), points[:, 2].max()
    x, y = middle[0] * along + middle[1] * across
    return OrientedBox(
        center=np.array([x, y, (bottom + top) / 2]),
        size=np.array([length, width, top - bottom]),
        yaw=yaw,
    )


def _best(ground: NDArray[np.float64], headings: NDArray[np.float64]) -> int:
    """Return the index of the heading that fits (n, 2) places best."""
    along = np.stack([np.cos(headings), np.sin(headings)], axis=1) @ ground.T
    across = np.stack([-np.sin(headings), np.cos(headings)], axis=1) @ ground.T
    to_side = np.minimum(_to_nearer_side(along), _to_nearer_side(across))
    closeness = (1 / np.maximum(to_side, NEAR_M)).sum(axis=1)
    as_good = closeness >= AS_GOOD * closeness.max()
    return int(np.argmin(np.where(as_good, np.ptp(along, axis=1) * np.ptp(across, axis=1), np.inf)))


def _to_nearer_side(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (headings, n) of places along an axis to that end of them to which they are nearer as a whole."""
    n = places.shape[1]
    stray = int(STRAY * (n - 1))
    in_order = np.partition(places, (stray, n - 1 - stray), axis=1)
    low, high = in_order[:, stray], in_order[:, n - 1 - stray]
    # the sum of the squared distances is less to that end on whose side of the middle the mean is
    nearer = np.where(places.mean(axis=1) < (low + high) / 2, low, high)
    return np.abs(places - nearer[:, None])
