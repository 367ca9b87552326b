"""A simulated frame that comes with the package, in KITTI's object layout; `make sample` makes it."""

from __future__ import annotations

from pathlib import Path

from ldls.datasets.frame import Frame
from ldls.datasets.kitti_object import KittiObjectSource

FOLDER = Path(__file__).parent / "training"


def sample_frame() -> Frame:
    """The street that `ldls demo` shows, with masks as a segmenter finds them and the true labels of its points.

    Cars, people, a truck, a bicycle and a dog, seen by KITTI's lidar and camera; of the sweep, the 100 degrees ahead.
    """
    return KittiObjectSource(FOLDER, masks="masks")[0]
