"""COCO JSON files as they are written: data sets, and bare lists of results."""

from __future__ import annotations

import json
from os import PathLike

from ldls.checks import as_python
from ldls.io.files import whole_file
from ldls.masks import InstanceMasks, coco

MAX_FILE_BYTES = 1 << 30
"""Larger files hold whole data sets; parsed, they take many times their size in memory."""


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
    own = coco.results(masks, masks.image_size, as_python(image_id))
    content = own if results else masks.to_coco(image_id=image_id, file_name=file_name)
    with whole_file(path) as file:
        file.write(json.dumps(content, separators=(",", ":")).encode())
