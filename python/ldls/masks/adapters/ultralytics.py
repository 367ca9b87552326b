"""`Results` of Ultralytics' segmentation networks for one image.

Source: https://docs.ultralytics.com/reference/engine/results/
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ldls import _ldls
from ldls.categories import category_ids
from ldls.errors import MaskError
from ldls.io.masks.records import MaskRecords
from ldls.masks.adapters.arrays import to_numpy, whole_numbers
from ldls.masks.image_size import checked_size
from ldls.masks.pixels import encode


def read(result: Any) -> MaskRecords:  # noqa: ANN401
    """The instances of one result.

    Masks of the image's size, as `retina_masks=True` makes them, are taken as they are. Those of the padded input give
    way to their outlines in the image, `masks.xy`, which are coarser and have no holes.

    Args:
        result: `masks` (`data` (N, h, w) and `xy`, N outlines in image pixels) or None, `boxes` (`cls`, `conf`),
            `names` and `orig_shape`.

    Raises:
        MaskError: An index that `names` does not have, or parts that do not fit one another.
    """
    size = checked_size(result.orig_shape)
    ids, names = category_ids(result.names)
    if result.masks is None:
        return MaskRecords(source="result", size=size, rles=[], categories=[], scores=[], names=names)
    classes = whole_numbers("boxes.cls", result.boxes.cls)
    for i, index in enumerate(classes):
        if index not in ids:
            raise MaskError(f"mask {i}: class {index} has no name; found {len(ids)} names")
    return MaskRecords(
        source="result",
        size=size,
        rles=_rles(result.masks, size),
        categories=[ids[index] for index in classes],
        scores=to_numpy(result.boxes.conf),
        names=names,
    )


def _rles(masks: Any, size: tuple[int, int]) -> list[_ldls.Rle]:  # noqa: ANN401
    pixels = to_numpy(masks.data)
    if pixels.shape[1:] == size:
        return [encode(i, mask) for i, mask in enumerate(pixels)]
    return [_from_outline(i, to_numpy(outline), size) for i, outline in enumerate(masks.xy)]


def _from_outline(index: int, outline: Any, size: tuple[int, int]) -> _ldls.Rle:  # noqa: ANN401
    if len(outline) < 3:  # of a mask without pixels, or with next to none
        return _ldls.Rle.from_pixels(np.zeros(size, np.bool_))
    try:
        return _ldls.Rle.from_polygons(*size, [outline.ravel().tolist()])
    except MaskError as error:
        raise MaskError(f"mask {index}: {error}") from None
