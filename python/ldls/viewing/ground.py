"""The part of the ground that a bird's-eye view shows, and the places of the picture on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import finite_rows
from ldls.errors import ParameterError
from ldls.segmentation import Segmentation

WIDTH_PX, HEIGHT_PX = 1800, 1200
"""Greatest size of a picture."""
LEAST_RANGE_M, MOST_RANGE_M = 10.0, 120.0
MARGIN_M = 1.5


@dataclass(frozen=True, eq=False, kw_only=True)
class Ground:
    """A part of the ground, and its place in a picture.

    Attributes:
        forward: (2,) unit vector in the lidar frame that points up in the picture.
        left_m, right_m, behind_m, ahead_m: Its edges, in metres from the lidar.
        px_per_m: Scale.
    """

    forward: NDArray[np.float64]
    left_m: float
    right_m: float
    behind_m: float
    ahead_m: float
    px_per_m: float

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the picture."""
        across, along = self.right_m - self.left_m, self.ahead_m - self.behind_m
        return round(across * self.px_per_m), round(along * self.px_per_m)

    def at(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) places in the picture, right and down in pixels, of (n, 2) places on the ground in metres."""
        sideways, ahead = _turned(xy, self.forward).T
        return np.stack([sideways - self.left_m, self.ahead_m - ahead], axis=1) * self.px_per_m


def ground_of(
    result: Segmentation,
    range_m: float | None = None,
    *,
    size_px: tuple[int, int] = (WIDTH_PX, HEIGHT_PX),
    fill: bool = False,
) -> Ground:
    """The part of the ground that a picture of a result shows, as large as fits into a width and a height.

    With `fill`, room that is left at the sides shows more of the ground. Of a result without a point in view, all
    points are shown.

    Raises:
        ParameterError: The range is not more than 0.
    """
    if range_m is not None and not range_m > 0:
        raise ParameterError(f"range_m: got {range_m}, expected more than 0")
    forward = _heading(result)
    rows = result.in_view if len(result.in_view) else finite_rows(result.points)
    seen = _turned(result.points[rows, :2].astype(np.float64), forward)
    ranges = np.hypot(*seen.T)
    objects = result.labels[rows] > 0
    reach = range_m or _reach(ranges[objects] if objects.any() else ranges)
    corners = [each.box.corners()[:4, :2] for each in result.objects if each.box is not None]
    held = _turned(np.concatenate([np.zeros((1, 2)), *corners]), forward)
    near = np.concatenate([seen[ranges <= reach], held[np.hypot(*held.T) <= (range_m or MOST_RANGE_M)]])
    left, behind = near.min(axis=0) - MARGIN_M
    right, ahead = near.max(axis=0) + MARGIN_M
    scale = min(size_px[0] / (right - left), size_px[1] / (ahead - behind))
    if fill:
        wider = size_px[0] / scale - (right - left)
        left, right = left - wider / 2, right + wider / 2
    return Ground(forward=forward, left_m=left, right_m=right, behind_m=behind, ahead_m=ahead, px_per_m=scale)


def _heading(result: Segmentation) -> NDArray[np.float64]:
    """(2,) direction in which the first camera looks along the ground of the lidar frame.

    It is x if the camera looks up or down, or if there is none.
    """
    if not result.views:
        return np.array([1.0, 0.0])
    axis: NDArray[np.float64] = result.views[0].view.camera.T_camera_lidar[2, :2]
    length = np.hypot(*axis)
    return axis / length if length > 1e-6 else np.array([1.0, 0.0])


def _turned(xy: NDArray[np.float64], forward: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) metres to the right of and along `forward`."""
    return np.asarray(xy @ np.array([[forward[1], forward[0]], [-forward[0], forward[1]]]))


def _reach(ranges_m: NDArray[np.float64]) -> float:
    farthest = float(np.quantile(ranges_m, 0.995)) if len(ranges_m) else 0.0
    return min(max(1.12 * farthest, LEAST_RANGE_M), MOST_RANGE_M)
