"""A result as pictures show it: labels at a stage, colours, names and images."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.checks import as_array, choice, shown
from ldls.errors import InputError
from ldls.palette import Colour, as_tuples, label_colours
from ldls.segmentation import Segmentation

Stage = Literal["direct", "diffused", "final"]
AnImage = NDArray[np.uint8] | Image.Image
Images = AnImage | Sequence[AnImage | None] | None

STAGES = {"direct": "direct_labels", "diffused": "diffused_labels", "final": "labels"}
"""Field of a result that has the labels of a stage."""
CANVAS: Colour = (38, 38, 42)
"""Colour of an image that is not there."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Shown:
    """A result as a picture shows it.

    Attributes:
        result: The result.
        labels: (N,) int32 label of each point at the stage shown.
        colours: Colour of each of the M instances.
        names: Name of each instance, with its number: "car 3".
        marked: (N,) True for points with a white rim.
    """

    result: Segmentation
    labels: NDArray[np.int32]
    colours: list[Colour]
    names: list[str]
    marked: NDArray[np.bool_]

    @classmethod
    def of(cls, result: Segmentation, stage: Stage, marked: NDArray[np.bool_] | None = None) -> Self:
        """A result with its labels by direct projection, after diffusion, or after outlier removal.

        Raises:
            ParameterError: There is no such stage.
        """
        return cls(
            result=result,
            labels=getattr(result, STAGES[choice("stage", stage, STAGES)]),
            colours=as_tuples(label_colours(result.instances)[1:]),
            names=names_of(result),
            marked=np.zeros(len(result.labels), bool) if marked is None else marked,
        )

    def colours_of(self, labels: NDArray[np.int32]) -> NDArray[np.uint8]:
        """(n, 3) colours of the instances `labels` (n,), each 1 or more."""
        return np.array(self.colours, np.uint8).reshape(-1, 3)[labels - 1]


def names_of(result: Segmentation) -> list[str]:
    """Name of each instance, with its label, or where the result is tracked its track: "car 3"."""
    numbers = result.instance_ids[1:].tolist()
    return [numbered(each.name, number) for each, number in zip(result.instances, numbers, strict=True)]


def numbered(name: str, number: int) -> str:
    """A name with a number, if it has one above 0: "car 3"."""
    return f"{name} {number}" if number else name


def images_of(result: Segmentation, images: Images) -> list[NDArray[np.uint8]]:
    """An image for every view: one of those given, or a dark one where there is none.

    Raises:
        InputError: There is no camera, there are more or fewer images than cameras, or one has not the size of the
            masks.
    """
    if not result.views:
        raise InputError("result: has no views, expected one or more to draw; birds_eye_view draws its points")
    given: Any = [None] * len(result.views) if images is None else images
    several = isinstance(given, Iterable) and not isinstance(given, str) and getattr(given, "ndim", 4) == 4
    each = list(given) if several else [given]
    if len(each) != len(result.views):
        raise InputError(f"images: got {len(each)}, expected {len(result.views)}, one a camera")
    return [image_like(image, seen.view.masks.image_size) for image, seen in zip(each, result.views, strict=True)]


def image_like(image: AnImage | None, size: tuple[int, int]) -> NDArray[np.uint8]:
    """`image` (H, W, 3), or a dark one of the size if it is None.

    Raises:
        InputError: It is of another size or type.
    """
    if image is None:
        return np.full((*size, 3), CANVAS, np.uint8)
    pixels = as_array("image", image, InputError)
    if pixels.shape[2:] == (3,) and pixels.dtype == np.uint8 and pixels.shape[:2] != size:
        sides = " x ".join(map(str, pixels.shape[:2]))
        raise InputError(f"image: got {sides} (height x width), the masks are of {size[0]} x {size[1]}")
    if pixels.shape != (*size, 3) or pixels.dtype != np.uint8:
        found = f"{pixels.shape} {pixels.dtype}" if pixels.ndim else shown(image)
        raise InputError(
            f"image: expected {(*size, 3)} uint8, the size of the masks, got {found}; read it with ldls.read_image"
        )
    return pixels
