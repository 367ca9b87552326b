"""What pictures show of a result: which labels, in which colours, under which names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ldls.errors import InputError, ParameterError
from ldls.palette import Colour, instance_colours
from ldls.segmentation import Segmentation

Stage = Literal["direct", "diffused", "final"]
Images = NDArray[np.uint8] | Sequence[NDArray[np.uint8] | None] | None

CANVAS: Colour = (38, 38, 42)
"""Colour of an image that is not there."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Shown:
    """A result as a picture shows it.

    Attributes:
        result: The result.
        labels: (N,) int32 label of each point at the stage shown.
        colours: (M, 3) uint8 colour of each instance.
        names: Name of each instance, with its label: "car 3".
        marked: (N,) whether a point is to be marked.
    """

    result: Segmentation
    labels: NDArray[np.int32]
    colours: NDArray[np.uint8]
    names: tuple[str, ...]
    marked: NDArray[np.bool_]

    def colours_of(self, labels: NDArray[np.int32]) -> NDArray[np.uint8]:
        """(n, 3) colours of the instances `labels` (n,), each 1 or more."""
        return np.asarray(self.colours[labels - 1])


def shown(result: Segmentation, stage: Stage, marked: NDArray[np.bool_] | None = None) -> Shown:
    """A result at a stage of the method.

    Raises:
        ParameterError: There is no such stage.
    """
    return Shown(
        result=result,
        labels=labels_at(result, stage),
        colours=instance_colours(instance.category for instance in result.instances),
        names=tuple(f"{instance.name} {instance.label}" for instance in result.instances),
        marked=np.zeros(len(result.labels), bool) if marked is None else marked,
    )


def labels_at(result: Segmentation, stage: Stage) -> NDArray[np.int32]:
    """(N,) int32 labels by direct projection, after diffusion, or after outlier removal.

    Raises:
        ParameterError: There is no such stage.
    """
    stages = {"direct": "direct_labels", "diffused": "diffused_labels", "final": "labels"}
    if stage not in stages:
        raise ParameterError(f"stage: got {stage!r}, expected {', '.join(stages)}")
    labels: NDArray[np.int32] = getattr(result, stages[stage])
    return labels


def images_of(result: Segmentation, images: Images) -> list[NDArray[np.uint8]]:
    """An image for every view: one of those given, or a dark one where there is none.

    Raises:
        InputError: There are more or fewer images than cameras, or one has not the size of the masks.
    """
    if images is None:
        images = [None] * len(result.views)
    each = [images] if isinstance(images, np.ndarray) and images.ndim == 3 else list(images)
    if len(each) != len(result.views):
        raise InputError(f"images: got {len(each)}, expected {len(result.views)}, one a camera")
    return [image_like(image, seen.view.masks.image_size) for image, seen in zip(each, result.views, strict=True)]


def image_like(image: NDArray[np.uint8] | None, size: tuple[int, int]) -> NDArray[np.uint8]:
    """`image` (H, W, 3), or a dark one of the size if it is None.

    Raises:
        InputError: It is of another size or type.
    """
    if image is None:
        return np.full((*size, 3), CANVAS, np.uint8)
    if image.shape != (*size, 3) or image.dtype != np.uint8:
        raise InputError(
            f"image: expected {(*size, 3)} uint8, the size of the masks, got {image.shape} {image.dtype}; "
            "read it with ldls.read_image"
        )
    return image
