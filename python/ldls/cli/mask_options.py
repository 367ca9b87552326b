"""Instance masks for commands: from files, or from a segmenter that runs on the images."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ldls.cli.messages import console
from ldls.cli.options import refuse, words
from ldls.errors import InputError, ParameterError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ldls.datasets import Source
    from ldls.masks import InstanceMasks

SEGMENTER = typer.Option(
    metavar="NAME[:FILE]",
    help="What makes masks of the image: onnx:MODEL.onnx, torchvision[:NAME], boxes:LABEL_2.txt or "
    "grabcut:LABEL_2.txt.",
    show_default=False,
)
FrameSegmenterOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME[:FILE]",
        help="What makes masks of the images: onnx:MODEL.onnx, torchvision[:NAME], boxes:label_2/{frame}.txt or "
        "grabcut:label_2/{frame}.txt; for several cameras boxes:boxes/{camera}/{frame}.txt.",
        show_default=False,
    ),
]
MinScoreOption = Annotated[
    float | None,
    typer.Option(metavar="X", help="Lowest score of a mask that counts.", show_default="0.5 of a network, 0 of a file"),
]
CategoriesOption = Annotated[
    str | None,
    typer.Option(metavar="WORDS", help="Categories that count, by name or id: car,person.", show_default="all"),
]


def masks_of(
    image: NDArray[np.uint8] | None,
    *,
    masks: Path | None,
    segmenter: str | None,
    image_id: str | None = None,
    image_size: tuple[int, int] | None = None,
    min_score: float | None = None,
    categories: str | None = None,
) -> InstanceMasks:
    """The wanted masks of an image, from a file or from a segmenter.

    Raises:
        InputError: Neither or both are given, or a segmenter and no image.
        ParameterError: A segmenter is given, and which image of a file it is; or no category.
        MaskError: The masks are of an image of another size.
    """
    if (masks is None) == (segmenter is None):
        given = "neither" if masks is None else "both"
        raise InputError(f"give --masks FILE or --segmenter NAME, got {given}; see --help for the segmenters")
    if masks is not None:
        from ldls.io import read_masks

        size = image_size if image is None else (image.shape[0], image.shape[1])
        stored = read_masks(masks, image_id=image_id, image_size=size)
        return wanted(stored, min_score=min_score, categories=categories)
    from ldls.segmenters import open_segmenter

    refuse({"image-id": image_id}, "which image of --masks it is, and --segmenter makes masks of --image")
    assert segmenter is not None
    opened = open_segmenter(segmenter, min_score=min_score)
    if image is None:
        raise InputError("--segmenter: needs --image, the image that it makes masks of")
    return wanted(opened(image), min_score=min_score, categories=categories)


def wanted(masks: InstanceMasks, *, min_score: float | None, categories: str | None) -> InstanceMasks:
    """The masks that score at least `min_score` and are of one of the categories of a list separated by commas."""
    return masks.filter(min_score=min_score or 0.0, categories=chosen_categories(categories))


def say_own_masks(source: Source, masks: str | None, segmenter: str | None) -> bool:
    """True for a source whose own masks are taken, as neither others nor a segmenter are given; a line says so."""
    from ldls.datasets.stored_masks import own_masks

    places = own_masks(source)
    if masks is not None or segmenter is not None or not places:
        return False
    named = ", ".join(f"{camera}: {place}" for camera, place in places.items())
    console().print(f"masks are those that {source.path} names ({named})", soft_wrap=True)
    return True


def chosen_categories(text: str | None) -> tuple[int | str, ...] | None:
    """The categories of a list separated by commas, numbers as ids and the rest as names; None where there is none.

    Raises:
        ParameterError: The list is empty.
    """
    if text is None:
        return None
    if not words(text):
        raise ParameterError("--categories: expected at least one, as car; leave it out for all")
    return tuple(int(word) if word.isdecimal() else word for word in words(text))
