"""LDLS: 2D instance masks become instance labels of lidar points, by label diffusion.

Names and rooms are imported when they are first used, so that the command line answers at once.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ldls import stages as stages
    from ldls._ldls import __version__ as __version__
    from ldls.camera import Camera as Camera, Distortion as Distortion, extrinsic as extrinsic  # type: ignore[no-redef]
    from ldls.errors import (
        CalibrationError as CalibrationError,
        CorruptFileError as CorruptFileError,
        DtypeError as DtypeError,
        FileFormatError as FileFormatError,
        InputError as InputError,
        InternalError as InternalError,
        LdlsError as LdlsError,
        LimitError as LimitError,
        MaskError as MaskError,
        NonFiniteError as NonFiniteError,
        ParameterError as ParameterError,
        PoseError as PoseError,
        ShapeError as ShapeError,
        SourceError as SourceError,
        TruncatedFileError as TruncatedFileError,
        UnsafeFileError as UnsafeFileError,
        UnsafePathError as UnsafePathError,
        UnsupportedFormatError as UnsupportedFormatError,
    )
    from ldls.explaining import Explanation as Explanation, explain as explain  # type: ignore[no-redef]
    from ldls.io import (
        read_camera as read_camera,
        read_image as read_image,
        read_masks as read_masks,
        read_points as read_points,
        read_poses as read_poses,
        read_result as read_result,
        save as save,
        save_objects as save_objects,
    )
    from ldls.label_diffusion import segment as segment
    from ldls.masks import InstanceMasks as InstanceMasks
    from ldls.params import Params as Params
    from ldls.segmentation import (
        Instance as Instance,
        OrientedBox as OrientedBox,
        Report as Report,
        Segmentation as Segmentation,
        SegmentedObject as SegmentedObject,
    )
    from ldls.sequences import (  # type: ignore[no-redef]
        LabelDiffusion as LabelDiffusion,
        LabelledMap as LabelledMap,
        Sweep as Sweep,
        Tracker as Tracker,
        Trajectory as Trajectory,
        odometry as odometry,
        segment_sweeps as segment_sweeps,
    )
    from ldls.view import SeenView as SeenView, View as View

_NAMES = {
    "ldls._ldls": ("__version__",),
    "ldls.camera": ("Camera", "Distortion", "extrinsic"),
    "ldls.errors": (
        "CalibrationError",
        "CorruptFileError",
        "DtypeError",
        "FileFormatError",
        "InputError",
        "InternalError",
        "LdlsError",
        "LimitError",
        "MaskError",
        "NonFiniteError",
        "ParameterError",
        "PoseError",
        "ShapeError",
        "SourceError",
        "TruncatedFileError",
        "UnsafeFileError",
        "UnsafePathError",
        "UnsupportedFormatError",
    ),
    "ldls.explaining": ("Explanation", "explain"),
    "ldls.io": (
        "read_camera",
        "read_image",
        "read_masks",
        "read_points",
        "read_poses",
        "read_result",
        "save",
        "save_objects",
    ),
    "ldls.label_diffusion": ("segment",),
    "ldls.masks": ("InstanceMasks",),
    "ldls.params": ("Params",),
    "ldls.segmentation": ("Instance", "OrientedBox", "Report", "Segmentation", "SegmentedObject"),
    "ldls.sequences": ("LabelDiffusion", "LabelledMap", "Sweep", "Tracker", "Trajectory", "odometry", "segment_sweeps"),
    "ldls.view": ("SeenView", "View"),
}
"""The public names, by the module that they come from."""
_HOMES = {name: module for module, names in _NAMES.items() for name in names}

__all__ = sorted([*_HOMES, "stages"])


def __getattr__(name: str) -> Any:  # noqa: ANN401 - any public name
    if name in _HOMES:
        value = globals()[name] = getattr(import_module(_HOMES[name]), name)
        return value
    if not name.startswith("__") and find_spec(f"ldls.{name}") is not None:
        return import_module(f"ldls.{name}")
    raise AttributeError(f"module 'ldls' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _html_of(result: "Segmentation") -> str:
    """HTML of a result for notebooks: pictures lie above the nouns, which know nothing of them."""
    from ldls.viewing.notebook import html_of

    return html_of(result)
