"""The output of torchvision's instance segmentation networks for one image.

Source: https://docs.pytorch.org/vision/stable/models/generated/torchvision.models.detection.maskrcnn_resnet50_fpn.html
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ldls.categories import COCO_NAMES
from ldls.errors import MaskError
from ldls.io.masks.records import MaskRecords
from ldls.masks.adapters.arrays import to_numpy, whole_numbers
from ldls.masks.pixels import encode


def read(output: Mapping[str, Any], *, threshold: float = 0.5, names: Mapping[int, str] | None = None) -> MaskRecords:
    """The instances of one element of the list that a network returns.

    Args:
        output: `labels` (N,), which are COCO's 91-space ids already, `scores` (N,) and `masks` (N, 1, H, W)
            probabilities.
        threshold: Least probability of a pixel of the object.
        names: Name of each label; COCO's without them.

    Raises:
        MaskError: A part is missing, or of another shape.
    """
    missing = [key for key in ("labels", "scores", "masks") if key not in output]
    if missing:
        raise MaskError(f"output: {missing[0]!r} is missing, found {sorted(output)}; a detector without masks?")
    masks = to_numpy(output["masks"])
    if masks.ndim != 4 or masks.shape[1] != 1:
        raise MaskError(f"masks: expected (N, 1, height, width), got shape {masks.shape}")
    return MaskRecords(
        source="torchvision output",
        size=masks.shape[2:],
        rles=[encode(i, mask[0], threshold) for i, mask in enumerate(masks)],
        categories=whole_numbers("labels", output["labels"]),
        scores=to_numpy(output["scores"]),
        names=COCO_NAMES if names is None else names,
    )
