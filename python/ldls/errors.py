"""Errors and warnings of `ldls`, each with a stable `code`.

Messages name the argument or file, what was found, what was expected, and how to mend it. A missing file stays
`FileNotFoundError`, a full disk `OSError`, and a lack of memory `MemoryError`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from typing import ClassVar


class LdlsError(Exception):
    """Base class of the errors of `ldls`."""

    code: ClassVar[str] = "ldls"


class InputError(LdlsError, ValueError):
    """An argument that cannot be used."""

    code = "input"


class ShapeError(InputError):
    """An array of the wrong shape."""

    code = "shape"


class DtypeError(InputError, TypeError):
    """An array of the wrong type."""

    code = "dtype"


class NonFiniteError(InputError):
    """NaN or infinity where `nonfinite="raise"` forbids it."""

    code = "nonfinite"


class CalibrationError(InputError):
    """A calibration that cannot be a camera's."""

    code = "calibration"


class MaskError(InputError):
    """Instance masks that contradict themselves, their image or their categories."""

    code = "mask"


class ParameterError(InputError):
    """A parameter outside its range."""

    code = "parameter"


class PoseError(InputError):
    """Poses of a drive that cannot be its way, or have none for a moment."""

    code = "pose"


class SourceError(InputError):
    """A source of frames that is not whole, or of an unknown kind."""

    code = "source"


class FileFormatError(LdlsError, ValueError):
    """A file that is not what its format says."""

    code = "file_format"


class TruncatedFileError(FileFormatError):
    """A file that ends too early."""

    code = "truncated_file"


class CorruptFileError(FileFormatError):
    """A file whose content contradicts itself."""

    code = "corrupt_file"


class UnsupportedFormatError(FileFormatError):
    """A file of a format or variant that is not supported."""

    code = "unsupported_format"


class UnsafeFileError(FileFormatError):
    """A file that would run code or exhaust memory if it were loaded."""

    code = "unsafe_file"


class UnsafePathError(LdlsError):
    """A path in a file that leads out of the folder it belongs to."""

    code = "unsafe_path"


class LimitError(LdlsError):
    """Input that exceeds a stated limit."""

    code = "limit"


class BatchError(LdlsError):
    """A run over many frames that cannot begin, go on or end well.

    Attributes:
        failures: What went wrong with which frame, where it was frames.
    """

    code = "batch"

    def __init__(self, message: str, failures: Sequence[object] = ()) -> None:
        """An error with its `message`, and the failures of frames."""
        super().__init__(message)
        self.failures = tuple(failures)


class InternalError(LdlsError):
    """A bug in `ldls`; please report it."""

    code = "internal"


class LdlsWarning(UserWarning):
    """Base class of the warnings of `ldls`."""


class NoUsablePoints(LdlsWarning):
    """No point has finite coordinates."""


class UprightWarning(LdlsWarning):
    """What is up to the lidar does not point up in an image, or in the world of its poses."""


class ImageSizeWarning(LdlsWarning):
    """Masks of an image that is probably not the camera's, but resized, or of rows for columns."""


class NothingInView(LdlsWarning):
    """No point is in view, or none of those in view is on a mask."""


class PrecisionWarning(LdlsWarning):
    """Coordinates too large for single precision to resolve, or intensities that a file cannot hold as they are."""


class ScaleWarning(LdlsWarning):
    """A cloud, or a translation, so large that its unit is probably not the metre."""


class DuplicateWarning(LdlsWarning):
    """Every point has so many copies that the point graph falls into islands."""


class RecoveredFileWarning(LdlsWarning):
    """A truncated file of which the whole part was read."""


class LeftOutWarning(LdlsWarning):
    """Sweeps that no frame or pose is made of, or annotations without a mask, for what belongs to them is missing."""


class ChangedFileWarning(LdlsWarning):
    """Results of an earlier run that somebody changed since; they are made again."""


def some(names: Sequence[str], most: int = 8) -> str:
    """The first of `names`, at the most so many, and how many more there are."""
    listed = ", ".join(names[:most])
    return listed if len(names) <= most else f"{listed} and {len(names) - most} more"


@contextmanager
def within(place: str | PathLike[str]) -> Iterator[None]:
    """Begin the message of an error of `ldls` that leaves the block, once, with the file or argument it is about."""
    try:
        yield
    except LdlsError as error:
        if str(error).startswith((f"{place}: ", f"{place}, ")):
            raise
        raise type(error)(f"{place}: {error}") from None
