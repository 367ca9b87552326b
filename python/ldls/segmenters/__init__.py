"""Segmenters: from an image to instance masks.

What a segmenter needs beyond numpy is imported when one is made: extras `onnx`, `torch` and `grabcut`.
"""

from ldls.segmenters.boxes import BoxSegmenter
from ldls.segmenters.onnx import OnnxSegmenter
from ldls.segmenters.registry import SEGMENTERS, open_segmenter
from ldls.segmenters.segmenter import Segmenter
from ldls.segmenters.torchvision import TorchvisionSegmenter

__all__ = [
    "SEGMENTERS",
    "BoxSegmenter",
    "OnnxSegmenter",
    "Segmenter",
    "TorchvisionSegmenter",
    "open_segmenter",
]
