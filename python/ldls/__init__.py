"""LDLS: 2D instance masks become instance labels of lidar points, by label diffusion."""

from ldls import stages
from ldls._ldls import __version__
from ldls.camera import Camera
from ldls.errors import (
    CalibrationError,
    CorruptFileError,
    DtypeError,
    FileFormatError,
    InputError,
    InternalError,
    LdlsError,
    LimitError,
    MaskError,
    NonFiniteError,
    ParameterError,
    ShapeError,
    TruncatedFileError,
    UnsafeFileError,
    UnsafePathError,
    UnsupportedFormatError,
)
from ldls.io import read_image, read_points
from ldls.masks import InstanceMasks
from ldls.objects import OrientedBox, SegmentedObject
from ldls.params import Params
from ldls.report import Report
from ldls.segmentation import LabelDiffusion, Segmentation, segment

__all__ = [
    "CalibrationError",
    "Camera",
    "CorruptFileError",
    "DtypeError",
    "FileFormatError",
    "InputError",
    "InstanceMasks",
    "InternalError",
    "LabelDiffusion",
    "LdlsError",
    "LimitError",
    "MaskError",
    "NonFiniteError",
    "OrientedBox",
    "ParameterError",
    "Params",
    "Report",
    "Segmentation",
    "SegmentedObject",
    "ShapeError",
    "TruncatedFileError",
    "UnsafeFileError",
    "UnsafePathError",
    "UnsupportedFormatError",
    "__version__",
    "read_image",
    "read_points",
    "segment",
    "stages",
]
