"""JSON files of masks: the content tells COCO, COCO panoptic, labelled polygons and Segment Anything apart."""

from __future__ import annotations

import json
from collections.abc import Mapping
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.checks import as_python
from ldls.io.files import MAX_TEXT_BYTES, open_file, whole_file
from ldls.io.images import decode
from ldls.io.masks import panoptic_png
from ldls.masks import InstanceMasks, adapters, coco, labelled_polygons


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
        CorruptFileError: The file is not JSON, or of none of these.
        LimitError: The file is too large.
    """
    with open_file(path, "JSON file", limit=MAX_TEXT_BYTES) as file:
        content = json.loads(file.text(), parse_constant=refuse_constant)
        return parse(content, Path(path), image_id=image_id, image_size=image_size, names=names)


def write(
    path: str | PathLike[str],
    masks: InstanceMasks,
    *,
    image_id: int = 1,
    file_name: str | None = None,
    results: bool = False,
) -> None:
    """Write COCO's: a data set of one image, or a bare list of results.

    Args:
        path: `.json` file.
        masks: Masks.
        image_id: Id of the image.
        file_name: Name of the image's file; without one there is none in the data set.
        results: True to write the bare list of results, which has no names and, without masks, no image size.
    """
    content: object = (
        coco.results(masks, masks.image_size, as_python(image_id))
        if results
        else masks.to_coco(image_id=image_id, file_name=file_name)
    )
    with whole_file(path) as file:
        file.write(json.dumps(content, separators=(",", ":")).encode())


def parse(
    content: Any,  # noqa: ANN401
    path: Path,
    *,
    image_id: int | str | None = None,
    image_size: tuple[int, int] | None = None,
    names: Mapping[int, str] | None = None,
) -> InstanceMasks:
    """The masks of one image of the parsed `content` of the file `path`; arguments and errors as of `read`."""
    if isinstance(content, dict) and "shapes" in content:
        return InstanceMasks(**labelled_polygons.from_shapes(content, decode=_decoded, names=names))
    if isinstance(content, dict) and "objects" in content:
        return InstanceMasks(**labelled_polygons.from_objects(content, names=names))
    if isinstance(content, dict) and panoptic_png.is_panoptic(content):
        return panoptic_png.read(path, content, image_id=image_id)
    if _is_sam(content):
        size = coco.size_of_record(_sam_image(content) or {}, image_size)
        return InstanceMasks(**adapters.from_sam(_records(content), names=names, image_size=size))
    return InstanceMasks(**coco.arguments(content, image_id=image_id, image_size=image_size, names=names))


def _decoded(png: bytes) -> NDArray[np.uint8]:
    return decode(BytesIO(png), len(png))


def refuse_constant(name: str) -> None:
    """Refuse NaN and its like, which JSON does not have."""
    raise ValueError(f"{name} is no JSON number")


def _records(content: Any) -> list[Any]:  # noqa: ANN401
    found = content.get("annotations") if isinstance(content, dict) else content
    return found if isinstance(found, list) else []


def _is_sam(content: Any) -> bool:  # noqa: ANN401
    """True for records with a predicted IoU and no category, or none beside the record of their one image."""
    records = _records(content)
    if not records:
        return _sam_image(content) is not None and "annotations" in content
    return all(
        isinstance(record, dict) and "predicted_iou" in record and "category_id" not in record for record in records
    )


def _sam_image(content: Any) -> dict[str, Any] | None:  # noqa: ANN401
    """The record of the one image, as SA-1B has it beside the annotations; COCO lists images."""
    image = content.get("image") if isinstance(content, dict) and "images" not in content else None
    return image if isinstance(image, dict) else None
