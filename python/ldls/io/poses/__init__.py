"""Poses of a drive: one module a format."""

from ldls.io.poses.read import READERS, read_poses

__all__ = ["READERS", "read_poses"]
