"""Drives: what belongs to several sweeps, one after the other."""

from ldls.sequences.trajectory import Trajectory

__all__ = ["Trajectory"]
