"""Upright boxes, and the one that fits the points of an object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.by_value import ByValue
from ldls.checks import checked, numbers
from ldls.errors import NonFiniteError


@dataclass(frozen=True, kw_only=True, eq=False)
class OrientedBox(ByValue):
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


@checked
def fit_upright_box(points: ArrayLike) -> OrientedBox:
    """The upright box around (n, 3) points in metres whose sides run along the sides that the lidar saw.

    Of 90 headings, one degree apart, it has the one at which points lie nearest to two sides that meet (closeness, of
    Zhang et al., Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners, IV 2017), and of those as good
    as that, the one of least area. Stray points do not decide where sides are, and of more than 150 points some decide;
    the box holds all. The order of the points does not matter.

    Raises:
        ShapeError: There are none, or they are no (n, 3).
        NonFiniteError: One is not finite.
    """
    xyz = numbers("points", points, np.float64, ("n", 3))
    if not np.isfinite(xyz).all():
        raise NonFiniteError("points: expected finite coordinates; leave other rows out first")
    center, size, yaw = _ldls.upright_box(xyz)
    return OrientedBox(center=np.array(center), size=np.array(size), yaw=yaw)
