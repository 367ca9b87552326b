"""COCO JSON files: data sets, and bare lists of results."""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike

from ldls.io.files import open_file, whole_file
from ldls.masks import InstanceMasks, coco

MAX_FILE_BYTES = 1 << 30
"""Larger files hold whole data sets; parsed, they take many times their size in memory."""


def read(
    path: str | PathLike[str],
    *,
    image_id: int | str | None = None,
    image_size: tuple[int, int] | None = None,
    names: Mapping[int, str] | None = None,
) -> InstanceMasks:
    """The masks of one image of a file.

    Args:
        path: `.json` file.
        image_id: Which image, where there are several.
        image_size: (height, width) in pixels, where the file does not say.
        names: Name of each category id, where the file does not say; COCO's own list without them.

    Raises:
        MaskError: An annotation cannot be used.
        CorruptFileError: The file is not JSON, or not COCO's.
        LimitError: The file is too large.
    """
    with open_file(path, "JSON file", limit=MAX_FILE_BYTES) as file:
        content = json.loads(file.text(), parse_constant=_refuse_constant)
        return InstanceMasks(**coco.arguments(content, image_id=image_id, image_size=image_size, names=names))


def write(
    path: str | PathLike[str],
    masks: InstanceMasks,
    *,
    image_id: int = 1,
    file_name: str | None = None,
    results: bool = False,
) -> None:
    """Write a data set of one image, or a bare list of results.

    Args:
        path: `.json` file.
        masks: Masks.
        image_id: Id of the image.
        file_name: Name of the image's file; without one there is none in the data set.
        results: Whether to write the bare list of results, which has no names and, without masks, no image size.
    """
    own = coco.results(masks, masks.image_size, image_id)
    content = own if results else masks.to_coco(image_id=image_id, file_name=file_name)
    with whole_file(path) as file:
        file.write(json.dumps(content, separators=(",", ":")).encode())


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON number")
