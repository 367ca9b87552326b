"""Drives: sweeps of several moments together, and the objects that go through them."""

from ldls.sequences.labelled_map import LabelledMap
from ldls.sequences.odometry import odometry
from ldls.sequences.stream import LabelDiffusion
from ldls.sequences.sweeps import Sweep, segment_sweeps
from ldls.sequences.tracker import Tracker
from ldls.sequences.trajectory import Trajectory

__all__ = ["LabelDiffusion", "LabelledMap", "Sweep", "Tracker", "Trajectory", "odometry", "segment_sweeps"]
