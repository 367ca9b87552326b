"""Instance masks of an image, and the ways to get them from what other programs hold in memory."""

from ldls.masks.instance_mask import InstanceMask
from ldls.masks.instance_masks import InstanceMasks

__all__ = ["InstanceMask", "InstanceMasks"]
