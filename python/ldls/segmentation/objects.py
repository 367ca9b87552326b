"""One record for each segmented instance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.segmentation.oriented_box import OrientedBox


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentedObject:
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
