"""Drives: sweeps of several moments together, and the objects that go through them."""

from ldls.sequences.odometry import odometry
from ldls.sequences.sweeps import Sweep, segment_sweeps
from ldls.sequences.tracker import Tracker
from ldls.sequences.trajectory import Trajectory

__all__ = ["Sweep", "Tracker", "Trajectory", "odometry", "segment_sweeps"]
