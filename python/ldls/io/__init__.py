"""Files: `read_` functions and `save`; below them one module a format."""

from ldls.io.cameras.read import read_camera
from ldls.io.images import read_image
from ldls.io.masks.formats import read_masks
from ldls.io.objects import save_objects
from ldls.io.points import read_points
from ldls.io.poses.read import read_poses
from ldls.io.results import read_result, save

__all__ = [
    "read_camera",
    "read_image",
    "read_masks",
    "read_points",
    "read_poses",
    "read_result",
    "save",
    "save_objects",
]
