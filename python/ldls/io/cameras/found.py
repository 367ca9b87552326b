"""What a calibration says of a camera, before it is checked as a whole."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ldls.camera.distortion import Distortion


@dataclass(frozen=True, eq=False, kw_only=True)
class FoundCamera:
    """The parts of a camera.

    Attributes:
        place: File or message, for errors.
        projection: (3, 3) intrinsic matrix or (3, 4) projection, to pixels.
        T_camera_lidar: (4, 4) rigid transform from lidar to camera coordinates.
        distortion: How the lens departs from a pinhole.
        image_size: (height, width) in pixels, if known.
        min_depth_m: Points at this depth or nearer are not in view, in metres.
    """

    place: str
    projection: NDArray[np.float64]
    T_camera_lidar: NDArray[np.float64]
    distortion: Distortion = field(default_factory=Distortion)
    image_size: tuple[int, int] | None = None
    min_depth_m: float = 0.1
