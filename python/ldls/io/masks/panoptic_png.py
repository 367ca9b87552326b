"""COCO panoptic: JSON of segments beside PNG whose colours number them, R + 256 G + 65536 B.

Source: https://cocodataset.org/#format-data.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ldls.categories import is_object
from ldls.errors import CorruptFileError, LdlsWarning, MaskError
from ldls.io.files import strictly_below
from ldls.io.images import read_image
from ldls.masks import InstanceMasks, instance_image
from ldls.masks.coco import by_id, chosen_image, parts


def is_panoptic(content: Mapping[str, Any]) -> bool:
    """True if annotations list the segments of an image."""
    annotations = content.get("annotations")
    return isinstance(annotations, list) and any("segments_info" in a for a in annotations if isinstance(a, dict))


def read(path: Path, content: Mapping[str, Any], *, image_id: int | str | None = None) -> InstanceMasks:
    """The things of one image; stuff (isthing 0) is background.

    Args:
        path: The JSON file; the PNG lie beside it, or in the folder of its name. Sizes of masks are theirs.
        content: The parsed JSON.
        image_id: Which image, where there are several.

    Raises:
        MaskError: There is no such image, or several and none was chosen; or a segment's category is not among the
            categories.
        CorruptFileError: A segment that the PNG does not have; a segment, category or annotation of the image that is
            there twice; or the image's annotation, segments or PNG are not said.
        FileNotFoundError: The PNG is not there.
    """
    annotations, images, names = parts(content)
    chosen = chosen_image(annotations, images, image_id)
    annotation = _annotation(annotations, chosen)
    file_name = annotation["file_name"]
    segments = by_id("segments_info", annotation.get("segments_info"), (int,))
    paths = [strictly_below(folder, file_name, place=str(path)) for folder in (path.parent, path.with_suffix(""))]
    png = next((each for each in paths if each.exists()), paths[0])
    colours = read_image(png)
    _check_size(path, images.get(chosen, {}), png, colours.shape[:2])
    values = colours.astype(np.int64) @ [1, 256, 65536]
    numbers, rles = instance_image.split(values)
    missing = sorted(segments.keys() - set(numbers.tolist()))
    if missing:
        raise CorruptFileError(f"segment {missing[0]} has no pixel in {file_name}")
    category_of = {number: segment.get("category_id") for number, segment in segments.items()}
    for number, category in category_of.items():
        if type(category) is not int or category not in names:
            raise MaskError(f"segment {number}: category_id {category!r} is not among the categories")
    categories = by_id("categories", content.get("categories", []), (int,))
    things = {i for i, category in categories.items() if category.get("isthing", 1) and is_object(names[i])}
    drawn = [
        (rle, category_of[number])
        for number, rle in zip(numbers.tolist(), rles, strict=True)
        if number in category_of and category_of[number] in things
    ]
    return InstanceMasks(
        [rle for rle, _ in drawn],
        (values.shape[0], values.shape[1]),
        categories=np.array([category for _, category in drawn], np.int64),
        names=names,
    )


def _annotation(annotations: list[dict[str, Any]], chosen: int | str | None) -> dict[str, Any]:
    """The only annotation of the image, with the name of its PNG."""
    own = [a for a in annotations if a.get("image_id") in (None, chosen)]
    if len(own) != 1:
        raise CorruptFileError(f"expected one annotation of image {chosen!r}, which lists its segments, got {len(own)}")
    if not isinstance(own[0].get("file_name"), str):
        raise CorruptFileError(
            f"the annotation of image {chosen!r} has file_name {own[0].get('file_name')!r}, expected that of its PNG"
        )
    return own[0]


def _check_size(path: Path, image: Mapping[str, Any], png: Path, size: tuple[int, ...]) -> None:
    """Warn of an image whose PNG has another size."""
    own = image.get("height"), image.get("width")
    if None not in own and own != size:
        swapped = "; swapped?" if own == size[::-1] else ""
        warnings.warn(
            f"{path}: image {image['id']!r} is {own} (height, width), its {png} is {size}, which is taken; mend the "
            f"image's height and width, or take its own PNG{swapped}",
            LdlsWarning,
            stacklevel=7,
        )
