"""Files of instance masks: the suffix chooses the format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import signature
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ldls.errors import MaskError, ParameterError, UnsupportedFormatError
from ldls.io.masks import coco, instance_png, kitti_boxes, npz, numpy_stack
from ldls.io.masks.records import MaskRecords
from ldls.masks.image_size import checked_size

if TYPE_CHECKING:
    from ldls.masks import InstanceMasks

READERS: dict[str, Callable[..., MaskRecords]] = {
    ".json": coco.read,
    ".png": instance_png.read,
    ".npz": npz.read,
    ".npy": numpy_stack.read,
    ".txt": kitti_boxes.read,
}

WRITERS: dict[str, Callable[..., None]] = {
    ".json": coco.write,
    ".png": instance_png.write,
    ".npz": npz.write,
    ".npy": numpy_stack.write,
}

_Function = TypeVar("_Function", bound=Callable[..., object])


def read(
    path: str | PathLike[str],
    *,
    image_size: tuple[int, int] | None = None,
    **options: Any,  # noqa: ANN401
) -> MaskRecords:
    """The instances of a file in the format of its suffix.

    Args:
        path: File of one of `READERS`.
        image_size: (height, width) of the image in pixels; the file must agree, where it says.
        options: Those of the format's reader; None stands for its default.

    Raises:
        UnsupportedFormatError: No format has this suffix.
        ParameterError: The format has no such option.
        MaskError: The file's image is of another size, or its masks cannot be used.
        FileFormatError: The file is broken.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    reader = _of_suffix(path, READERS, "read")
    given = {name: value for name, value in options.items() if value is not None}
    known = _check_options(path, reader, given)
    if image_size is None:
        return reader(path, **given)
    size = checked_size(image_size)
    records = reader(path, **given, **({"image_size": size} if "image_size" in known else {}))
    if size != records.size:
        hint = "; swapped?" if size == records.size[::-1] else ""
        raise MaskError(f"{path}: masks of {records.size} (height, width), the image is {size}{hint}")
    return records


def write(path: str | PathLike[str], masks: InstanceMasks, **options: Any) -> None:  # noqa: ANN401
    """Write `masks` in the format of the suffix of `path`.

    Args:
        path: File of one of `WRITERS`.
        masks: Masks.
        options: Those of the format's writer.

    Raises:
        UnsupportedFormatError: No format has this suffix.
        ParameterError: The format has no such option.
        MaskError: The format cannot keep these masks.
    """
    path = Path(path)
    writer = _of_suffix(path, WRITERS, "write")
    _check_options(path, writer, options)
    writer(path, masks, **options)


def _of_suffix(path: Path, known: Mapping[str, _Function], verb: str) -> _Function:
    function = known.get(path.suffix.lower())
    if function is None:
        raise UnsupportedFormatError(f"{path}: cannot {verb} {path.suffix!r} masks, expected {', '.join(known)}")
    return function


def _check_options(path: Path, function: Callable[..., object], options: Mapping[str, object]) -> list[str]:
    """The options of `function`, which `options` are among."""
    parameters = signature(function).parameters.values()
    known = [p.name for p in parameters if p.kind is p.KEYWORD_ONLY]
    for option in options:
        if option not in known:
            expected = f"expected {', '.join(known)}" if known else "they have none"
            raise ParameterError(f"{option}: no option of {path.suffix} masks ({path}); {expected}")
    return known
