"""LDLS: 2D instance masks become instance labels of lidar points, by label diffusion."""

from ldls import stages
from ldls._ldls import __version__
from ldls.camera import Camera, Distortion, extrinsic
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
    SourceError,
    TruncatedFileError,
    UnsafeFileError,
    UnsafePathError,
    UnsupportedFormatError,
)
from ldls.explaining import Explanation, explain
from ldls.io import read_camera, read_image, read_masks, read_points, read_result, save
from ldls.label_diffusion import LabelDiffusion, segment
from ldls.masks import InstanceMasks
from ldls.params import Params
from ldls.segmentation import Instance, OrientedBox, Report, Segmentation, SegmentedObject
from ldls.view import SeenView, View


def _html_of(result: Segmentation) -> str:
    from ldls.viewing.notebook import html_of

    return html_of(result)


# pictures lie above the nouns, which know nothing of them, and are imported when one is shown
Segmentation._repr_html_ = _html_of

__all__ = [
    "CalibrationError",
    "Camera",
    "CorruptFileError",
    "Distortion",
    "DtypeError",
    "Explanation",
    "FileFormatError",
    "InputError",
    "Instance",
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
    "SeenView",
    "Segmentation",
    "SegmentedObject",
    "ShapeError",
    "SourceError",
    "TruncatedFileError",
    "UnsafeFileError",
    "UnsafePathError",
    "UnsupportedFormatError",
    "View",
    "__version__",
    "explain",
    "extrinsic",
    "read_camera",
    "read_image",
    "read_masks",
    "read_points",
    "read_result",
    "save",
    "segment",
    "stages",
]
