"""Make the frame that comes with the package anew: `python tests/simulation/make_sample.py`, or `make sample`."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ldls.labeling import Labeling
from ldls.simulation import SimulatedFrame, scene_frame, write_kitti
from ldls.simulation.sample import FOLDER

SEED = 133
"""A street with most kinds of objects, none of them invented or of a wrong class."""
AHEAD_DEG = 50.0
"""The camera sees 41 degrees to either side; the rest of the turn would make the files three times as large."""


def ahead(frame: SimulatedFrame) -> SimulatedFrame:
    """The frame with the part of the sweep that lies ahead."""
    x, y = frame.points[:, :2].T
    kept = np.abs(np.degrees(np.arctan2(y, x))) <= AHEAD_DEG
    truth = frame.truth
    return replace(
        frame,
        points=frame.points[kept],
        rings=frame.rings[kept],
        truth=Labeling(truth.classes[kept], truth.instances[kept], truth.ignored[kept], truth.names),
    )


def make(folder: Path) -> None:
    """Write the frame to FOLDER/training."""
    write_kitti(folder, "000000", ahead(scene_frame(SEED)))


if __name__ == "__main__":
    make(FOLDER.parent)
