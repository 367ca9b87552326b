"""The way of a source's lidar, where the source has no poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ldls.checks import checked
from ldls.cloud import Points
from ldls.datasets.frame import Source
from ldls.errors import SourceError, within
from ldls.sequences import Trajectory, odometry

PERIOD_S = 0.1
"""Time between sweeps where the source has no stamps: lidars turn ten times a second."""


@checked
def odometry_of(source: Source) -> Trajectory:
    """Return the poses of the lidar at the frames of a drive, from its sweeps alone, by `ldls.odometry`.

    `poses[k]` is that of frame k. Its stamp is the frame's; where frames have none, frame k is taken at k x 0.1 s.
    Where frames have the times of their points, `ldls.odometry` takes the motion out of its sweeps.
    Frames are read one after the other, and none is kept.

    Args:
        source: The drive, its frames in the order of time.

    Raises:
        SourceError: Some frames have stamps and others none.
        PoseError: Stamps do not ascend, or a sweep has nothing in common with the one before it.
        InputError: There are fewer than two frames, or a sweep has too few finite points.
        LdlsError: A frame cannot be read.
        ImportError: `ldls[odometry]` is not installed.
    """
    with within(source.path):
        return odometry(_sweeps(source))


def _sweeps(source: Source) -> Iterator[tuple[float, Points] | tuple[float, Points, NDArray[np.float64]]]:
    stamped = None
    for number, frame in enumerate(source):
        if stamped is None:
            stamped = frame.stamp is not None
        if stamped != (frame.stamp is not None):
            lacks = "no stamp" if stamped else "a stamp"
            raise SourceError(
                f"frame {frame.name} has {lacks}, unlike those before it; expected stamps of all frames or of none"
            )
        stamp = number * PERIOD_S if frame.stamp is None else frame.stamp
        yield (stamp, frame.points) if frame.times is None else (stamp, frame.points, frame.times)
