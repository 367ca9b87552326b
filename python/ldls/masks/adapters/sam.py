"""What the automatic mask generators of Segment Anything return for one image.

Source: https://github.com/facebookresearch/segment-anything
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ldls import _ldls
from ldls.errors import MaskError
from ldls.io.masks import coco
from ldls.io.masks.records import MaskRecords
from ldls.masks.adapters.arrays import to_numpy
from ldls.masks.pixels import encode


def read(
    records: Sequence[Mapping[str, Any]],
    *,
    categories: ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    image_size: tuple[int, int] | None = None,
) -> MaskRecords:
    """The masks of a list of records.

    Args:
        records: Each with `segmentation`, (H, W) bool or COCO's run lengths, and `predicted_iou`, the score, which may
            lie a little above 1.
        categories: (M,) category ids; without them all are category 1, "object".
        names: Name of each category id.
        image_size: (height, width) of the image in pixels; only needed where there may be no mask.

    Raises:
        MaskError: A record that cannot be used, by its index.
    """
    rles = [_rle(i, record) for i, record in enumerate(records)]
    if not rles and image_size is None:
        raise MaskError("records: none, so the image's size is not known; pass image_size=(height, width)")
    size = (rles[0].height, rles[0].width) if image_size is None else image_size
    scores = np.array([record.get("predicted_iou", 1.0) for record in records], np.float32)
    return MaskRecords(
        source="records", size=size, rles=rles, categories=categories, scores=np.clip(scores, 0, 1), names=names
    )


def _rle(index: int, record: Mapping[str, Any]) -> _ldls.Rle:
    if "segmentation" not in record:
        raise MaskError(f"record {index}: 'segmentation' is missing, found {sorted(record)}")
    segmentation = record["segmentation"]
    if not isinstance(segmentation, Mapping):
        return encode(index, to_numpy(segmentation))
    try:
        return coco.from_rle(segmentation)
    except MaskError as error:
        raise MaskError(f"record {index}: {error}") from None
