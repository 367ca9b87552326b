"""The camera that took the image, and the distortion of its lens."""

from ldls.camera.camera import Camera
from ldls.camera.distortion import Distortion
from ldls.camera.extrinsic import extrinsic

__all__ = ["Camera", "Distortion", "extrinsic"]
