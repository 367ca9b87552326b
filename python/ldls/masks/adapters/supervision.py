"""`supervision.Detections`.

Source: https://supervision.roboflow.com/latest/detection/core/
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ldls.categories import category_ids
from ldls.errors import MaskError
from ldls.io.masks.records import MaskRecords
from ldls.masks.adapters.arrays import to_numpy, whole_numbers
from ldls.masks.pixels import encode


def read(
    detections: Any,  # noqa: ANN401
    *,
    names: Mapping[int, str] | None = None,
    image_size: tuple[int, int] | None = None,
) -> MaskRecords:
    """The instances of detections with masks.

    Args:
        detections: `mask` (N, H, W), `confidence` (N,) or None, `class_id` (N,) or None, and `data["class_name"]`.
        names: Name of each class id, where `data` does not say; a class without one is called by its number.
        image_size: (height, width) of the image in pixels; only needed where there may be no detection.

    Raises:
        MaskError: There are boxes and no masks, or arrays that do not fit one another.
    """
    masks = detections.mask
    if masks is None and len(detections.xyxy):
        raise MaskError(
            "detections: boxes without masks; InstanceMasks.from_boxes takes boxes for masks, "
            "and ldls.segmenters.BoxSegmenter does so frame by frame"
        )
    pixels = [] if masks is None else [to_numpy(mask) for mask in masks]
    if not pixels and image_size is None:
        raise MaskError("detections: none, so the image's size is not known; pass image_size=(height, width)")
    rles = [encode(i, mask) for i, mask in enumerate(pixels)]
    classes = _classes(detections, len(rles), names)
    size = (rles[0].height, rles[0].width) if image_size is None else image_size
    return MaskRecords(source="detections", size=size, rles=rles, scores=detections.confidence, **classes)


def _classes(detections: Any, count: int, names: Mapping[int, str] | None) -> dict[str, Any]:  # noqa: ANN401
    """Categories and their names; none where there are no class ids."""
    if detections.class_id is None:
        return {}
    indices = whole_numbers("class_id", detections.class_id)
    own = dict(names or {})
    found = [own.get(index, f"class {index}") for index in indices]
    found = [str(name) for name in detections.data.get("class_name", found)]
    if not len(indices) == len(found) == count:
        raise MaskError(f"detections: {count} masks, {len(indices)} class ids, {len(found)} class names")
    by_index = dict(zip(indices, found, strict=True))
    for i, (index, name) in enumerate(zip(indices, found, strict=True)):
        if index < 0:
            raise MaskError(f"mask {i}: class {index}, expected 0 or more")
        if by_index[index] != name:
            raise MaskError(f"mask {i}: class {index} is {name!r}, elsewhere {by_index[index]!r}; one name a class")
    ids, by_category = category_ids(by_index)
    return {"categories": [ids[index] for index in indices], "names": by_category}
