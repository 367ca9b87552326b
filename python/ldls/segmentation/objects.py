"""One record for each segmented instance, and rows of tables: plain values under names that carry their units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.by_value import ByValue
from ldls.masks import InstanceMask
from ldls.segmentation.oriented_box import OrientedBox
from ldls.view import SeenView

Row = dict[str, Any]
"""An object: a value for each of `COLUMNS`."""

COLUMNS = (
    "label", "track", "category", "name", "score", "n_points", "distance_m",
    "centroid_x_m", "centroid_y_m", "centroid_z_m",
    "box_x_m", "box_y_m", "box_z_m", "length_m", "width_m", "height_m", "yaw_rad",
    "velocity_x_m_s", "velocity_y_m_s",
    "camera", "mask_left_px", "mask_top_px", "mask_width_px", "mask_height_px",
)  # fmt: skip
"""Columns of a table of objects, in their order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentedObject(ByValue):
    """The points of one instance.

    Attributes:
        label: Its label m in `Segmentation.labels`.
        category: Category id.
        name: Category name.
        score: Score of the 2D segmenter.
        track: Its number in the drive, from 1; 0 where nobody tracked it.
        velocity: Metres a second along x and y of the world of the sweeps' poses; 0 where nobody tracked it.
        n_points: Points that carry its label.
        centroid: (3,) mean of these points in metres; None without points.
        box: The upright box that holds them, its sides along the sides seen; None without points.
    """

    label: int
    category: int
    name: str
    score: float
    track: int = 0
    velocity: tuple[float, float] = (0.0, 0.0)
    n_points: int
    centroid: NDArray[np.float64] | None
    box: OrientedBox | None

    @property
    def distance_m(self) -> float | None:
        """Distance from the lidar's origin to the centroid, in metres; None without points."""
        return None if self.centroid is None else float(np.linalg.norm(self.centroid))


def first_seen(sources: Sequence[tuple[int, int]], views: Sequence[SeenView]) -> tuple[int, InstanceMask] | None:
    """Number of the first view that shows an object with points, and its mask there; None if none does."""
    masks = ((view, views[view].view.masks[mask]) for view, mask in sorted(sources))
    # of several masks of an object one may be empty
    return next(((view, mask) for view, mask in masks if mask.area), None)
