"""Files: one module a format."""

from ldls.io.points import read_points

__all__ = ["read_points"]
