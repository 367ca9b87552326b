"""Files: one module a format."""

from ldls.io.images import read_image
from ldls.io.points import read_points

__all__ = ["read_image", "read_points"]
