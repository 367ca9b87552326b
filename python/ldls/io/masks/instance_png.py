"""PNG images of instance numbers: value m + 1 on the pixels of mask m, 0 on the background.

A text chunk, `ldls:instances`, keeps what pixels cannot: categories, scores, names, and instances without a pixel.
Files of other programs do without it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from PIL.PngImagePlugin import PngImageFile, PngInfo

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, category_ids
from ldls.errors import CorruptFileError, LimitError, MaskError, ParameterError, UnsupportedFormatError
from ldls.io.files import InputFile, open_file, parsing, whole_file
from ldls.io.images import MAX_BYTES, check_pixels
from ldls.masks import InstanceMasks, instance_image
from ldls.masks.instance_image import CITYSCAPES_DIVISOR

CITYSCAPES = "_instanceIds.png"
"""How the names of Cityscapes' files end."""
CITYSCAPES_NAMES = {
    24: "person", 25: "rider", 26: "car", 27: "truck", 28: "bus", 29: "caravan", 30: "trailer", 31: "train",
    32: "motorcycle", 33: "bicycle",
}  # fmt: skip
"""Its classes that have instances."""
CHUNK = "ldls:instances"
"""Keyword of the text chunk."""
VERSION = 1
"""Version of its content."""
MODES = {"1", "L", "P", "I", "I;16"}
"""Pillow's names of images with one number a pixel."""
MAX_PIXELS = 178_956_970
"""Most pixels that are unpacked, as in Pillow."""


def read(
    path: str | PathLike[str],
    *,
    categories: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    class_divisor: int | None = None,
) -> InstanceMasks:
    """The instances of a PNG of 8 or 16 bits; of a palette image the indices count, not the colours.

    Args:
        path: Image file.
        categories: As in `instance_image.arguments`, for files without our chunk.
        scores: As `categories`.
        names: As `categories`.
        class_divisor: As `categories`; 256 for KITTI's files.

    Raises:
        UnsupportedFormatError: The image has colours or transparency, or is of a later version.
        LimitError: It has more than `MAX_PIXELS`.
        CorruptFileError: It is no PNG, or not a whole one.
        ParameterError: Categories, scores or a divisor for a file that has its own.
    """
    given = {"categories": categories, "scores": scores, "names": names, "class_divisor": class_divisor}
    with open_file(path, "PNG image", limit=MAX_BYTES) as file:
        values, texts = _open(file)
        if CHUNK not in texts and Path(path).name.endswith(CITYSCAPES) and class_divisor in (None, CITYSCAPES_DIVISOR):
            return _cityscapes(values, scores, names)
        if CHUNK not in texts:
            return InstanceMasks(**instance_image.arguments(values, **given))  # type: ignore[arg-type]
        idle = [name for name, value in given.items() if value is not None]
        if idle:
            raise ParameterError(f"the file holds its own {idle[0]}; leave out {idle[0]}=")
        with parsing(f"text chunk {CHUNK}"):
            return _from_chunk(values, json.loads(texts[CHUNK]))


def _cityscapes(values: NDArray[Any], scores: ArrayLike | None, names: Mapping[int, str] | None) -> InstanceMasks:
    """Things of Cityscapes, which it numbers from 0 (26000 is a car), by the ids of COCO where it has the class."""
    # below the divisor there are stuff and groups
    numbers, rles = instance_image.split(np.where(values < CITYSCAPES_DIVISOR, 0, values))
    classes = (numbers // CITYSCAPES_DIVISOR).tolist()
    ids, own = category_ids(CITYSCAPES_NAMES | dict(names or {}))
    unknown = sorted(set(classes) - ids.keys())
    if unknown:
        raise MaskError(f"class {unknown[0]} is none of Cityscapes'; pass names={{{unknown[0]}: '...'}}")
    categories = np.array([ids[each] for each in classes], np.int64)
    height, width = values.shape
    return InstanceMasks(rles, (height, width), categories=categories, scores=scores, names=COCO_NAMES | own)


def write(path: str | PathLike[str], masks: InstanceMasks) -> None:
    """Write masks that do not overlap: 8 bits up to 255 masks, else 16.

    Raises:
        MaskError: Two masks share a pixel.
    """
    content = {
        "version": VERSION,
        "categories": masks.categories.tolist(),
        "scores": masks.scores.tolist(),
        "names": {str(category): name for category, name in masks.names.items()},
    }
    info = PngInfo()
    info.add_text(CHUNK, json.dumps(content, separators=(",", ":")))
    image = Image.fromarray(masks.to_instance_image())
    with whole_file(path) as file:
        image.save(file, "PNG", pnginfo=info)


def _open(file: InputFile) -> tuple[NDArray[Any], Mapping[str, str]]:
    """(H, W) values and the text chunks."""
    # opened as PNG and nothing else, and without Image.open, which warns of large images
    with PngImageFile(file) as image:
        _check_kind(image)
        check_pixels(image, file.size)
        image.verify()  # the sums of all chunks, which loading does not look at
    file.seek(0)
    with PngImageFile(file) as image:
        image.load()
        return np.asarray(image), image.text


def _check_kind(image: PngImageFile) -> None:
    if image.width * image.height > MAX_PIXELS:
        raise LimitError(f"{image.height} x {image.width} pixels, expected at most {MAX_PIXELS}")
    if image.mode not in MODES:
        raise UnsupportedFormatError(
            f"{image.mode} pixels, expected one number a pixel, grey of 8 or 16 bits or a palette; "
            "colours do not tell which instance a pixel belongs to"
        )


def _from_chunk(values: NDArray[Any], content: dict[str, Any]) -> InstanceMasks:
    if content["version"] != VERSION:
        raise UnsupportedFormatError(f"version {content['version']}, this ldls reads {VERSION}; update ldls")
    height, width = values.shape
    numbers, own_rles = instance_image.split(values)
    count = len(content["categories"])
    if numbers.size and numbers[-1] > count:
        raise CorruptFileError(f"value {numbers[-1]}, but text chunk {CHUNK} describes {count} instances")
    empty = _ldls.Rle.from_runs(height, width, np.array([height * width], np.uint32))
    rles = dict(zip(numbers.tolist(), own_rles, strict=True))
    return InstanceMasks(
        [rles.get(m + 1, empty) for m in range(count)],
        (height, width),
        categories=np.array(content["categories"], np.int64),
        scores=np.array(content["scores"], np.float32),
        names={int(category): str(name) for category, name in content["names"].items()},
    )
