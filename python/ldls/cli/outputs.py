"""The files that commands write for one frame."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.errors import CorruptFileError, LimitError, MaskError
from ldls.io.whole_file import whole_file
from ldls.masks import InstanceMasks
from ldls.segmentation import Segmentation

CANVAS = (38, 38, 42)
"""Colour behind masks and points where there is no image."""


class Output(StrEnum):
    """What a command can write."""

    NPZ = "npz"
    LABEL = "label"
    PLY = "ply"
    PNG = "png"


def write_outputs(
    folder: Path,
    name: str,
    result: Segmentation,
    image: NDArray[np.uint8] | None,
    formats: list[Output],
) -> list[Path]:
    """Write `result` to `folder` in every one of `formats`; the files written."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.{output}" for output in dict.fromkeys(formats)]
    for path in paths:
        if path.suffix == ".png":
            _write_picture(path, result, image)
        else:
            result.save(path)
    return paths


def read_image(path: Path, masks: InstanceMasks) -> NDArray[np.uint8]:
    """(H, W, 3) pixels of an image file, which must have the size of `masks`.

    Raises:
        CorruptFileError: It is no image, or not a whole one.
        MaskError: Its size is not that of the masks.
    """
    try:
        with Image.open(path) as image:
            size = (image.height, image.width)
            if size != masks.image_size:
                hint = "; swapped?" if size == masks.image_size[::-1] else ""
                raise MaskError(f"masks: {masks.image_size} (height, width), image {path.name} is {size}{hint}")
            return np.asarray(image.convert("RGB"))
    except Image.DecompressionBombError as error:
        raise LimitError(f"{path}: {error}") from None
    except (FileNotFoundError, PermissionError, IsADirectoryError):
        raise
    except (OSError, SyntaxError, ValueError) as error:
        if isinstance(error, MaskError):
            raise
        raise CorruptFileError(f"{path}: not a whole image ({error})") from None


def _write_picture(path: Path, result: Segmentation, image: NDArray[np.uint8] | None) -> None:
    from ldls.viewing import overlay

    if image is None:
        image = np.full((*result.masks.image_size, 3), CANVAS, np.uint8)
    masks = ((*mask.bounding_box[:2], mask.crop()) for mask in result.masks)
    names = [f"{mask.name} {mask.score:.2f}" for mask in result.masks]
    picture = overlay(image, masks, result.pixels, result.labels[result.in_view], names)
    with whole_file(path) as file:
        picture.save(file, "PNG")
