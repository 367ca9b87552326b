"""Sources of frames: data sets, drives, bags and folders, one module each."""

from ldls.datasets.frame import CameraImage, Frame, Source

__all__ = ["CameraImage", "Frame", "Source"]
