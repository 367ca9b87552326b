"""Point clouds from files: one module a format."""

from ldls.io.points.read import READERS, read_points

__all__ = ["READERS", "read_points"]
