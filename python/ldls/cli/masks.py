"""`ldls masks`: instance masks made, shown and changed from one format to another."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from ldls.cli.command import Command
from ldls.cli.frame_files import EXISTING, IMAGE_ID
from ldls.cli.mask_options import SEGMENTER, CategoriesOption, MinScoreOption, masks_of, wanted
from ldls.cli.messages import console, speaks_plainly
from ldls.errors import ParameterError

if TYPE_CHECKING:
    import numpy as np

    from ldls.masks import InstanceMasks

app = typer.Typer(help="Make, show and convert instance masks.", no_args_is_help=True)
SUFFIXES = "COCO .json, .npz, instance .png, .npy stack"
"""What masks are written as."""

MaskPictureOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE.png", help="Picture of the masks on the image.", show_default=False, dir_okay=False),
]
MasksArgument = Annotated[
    Path,
    typer.Argument(
        metavar="MASKS", help="File or folder of any format of docs/masks.md.", **(EXISTING | {"dir_okay": True})
    ),
]
OutArgument = Annotated[Path, typer.Argument(metavar="OUT", help=f"{SUFFIXES}: the suffix chooses.", dir_okay=False)]


class Priority(StrEnum):
    """Rule that leaves a pixel to one of several masks."""

    SCORE = "score"
    AREA = "area"
    ORDER = "order"


class Variant(StrEnum):
    """Variants of formats."""

    RESULTS = "results"
    RESEARCH = "research"
    PIXELS = "pixels"


VARIANTS: dict[Variant, dict[str, Any]] = {
    Variant.RESULTS: {"results": True},
    Variant.RESEARCH: {"layout": "research"},
    Variant.PIXELS: {"pixels_only": True},
}
"""Options of the writers, by variant."""


class Axis(StrEnum):
    """Axis of a stack that counts the instances."""

    FIRST = "first"
    LAST = "last"


AXES = {None: None, Axis.FIRST: 0, Axis.LAST: -1}


@app.command(cls=Command)
@speaks_plainly
def convert(
    masks: MasksArgument,
    out: OutArgument,
    image_id: Annotated[str | None, IMAGE_ID] = None,
    image_size: Annotated[
        str | None,
        typer.Option(metavar="HEIGHTxWIDTH", help="Size of the image, where the file does not say: 375x1242."),
    ] = None,
    instance_axis: Annotated[
        Axis | None,
        typer.Option(
            metavar="|".join(Axis),
            help="Axis of the instances in a .npy stack.",
            show_default="the one that is not the image's",
        ),
    ] = None,
    class_divisor: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Of a .png with class * DIVISOR + instance: 256 of KITTI, 1000 of KITTI-360.",
            show_default=False,
        ),
    ] = None,
    min_score: MinScoreOption = None,
    categories: CategoriesOption = None,
    min_area: Annotated[
        int, typer.Option(metavar="N", help="Fewest pixels of a mask that is kept, shrunk, grown and resolved.", min=0)
    ] = 0,
    shrink: Annotated[int, typer.Option(metavar="N", help="Take this many pixels off the edges of masks.", min=0)] = 0,
    grow: Annotated[int, typer.Option(metavar="N", help="Add this many pixels to the edges of masks.", min=0)] = 0,
    resolve: Annotated[
        Priority | None,
        typer.Option(
            metavar="|".join(Priority),
            help="Leave each pixel to one mask: of the highest score, the smallest area, or the first in order.",
            show_default="masks may overlap",
        ),
    ] = None,
    variant: Annotated[
        Variant | None,
        typer.Option(
            metavar="|".join(Variant),
            help="Write a bare list of results (.json), the arrays of the LDLS research code (.npz), or pixels without "
            "categories and scores (.npy).",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Change masks from one format to another, keeping pixels, categories, scores and names.

    A .png holds one instance a pixel: masks that overlap need --resolve.

    Example: ldls masks convert masks/000571.json masks/000571.png --resolve score --min-score 0.7
    """
    from ldls.io import read_masks, save
    from ldls.io.files import check_outputs

    check_outputs({"OUT": [out]}, [masks])
    read = read_masks(
        masks,
        image_id=image_id,
        image_size=parsed_size(image_size),
        instance_axis=AXES[instance_axis],
        class_divisor=class_divisor,
    )
    kept = wanted(read, min_score=min_score, categories=categories)
    if shrink:
        kept = kept.shrink(shrink)
    if grow:
        kept = kept.grow(grow)
    kept = kept.filter(min_area=min_area)
    if resolve is not None:
        # what too small a mask holds is left to others, and what is left of one may be too small
        kept = kept.resolve_overlaps(resolve.value).filter(min_area=min_area)
    save(kept, out, **(VARIANTS[variant] if variant else {}))
    console().print(f"wrote {len(kept)} of {len(read)} masks to {out}", soft_wrap=True)


@app.command(cls=Command)
@speaks_plainly
def make(
    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="Camera image.", **EXISTING)],
    out: OutArgument,
    segmenter: Annotated[str, SEGMENTER],
    min_score: MinScoreOption = None,
    categories: CategoriesOption = None,
    picture: MaskPictureOption = None,
) -> None:
    """Make masks of an image with a segmenter.

    Example: ldls masks make image_2/000571.png masks/000571.json --segmenter onnx:yolo11n-seg.onnx
    """
    from ldls.io import read_image, save
    from ldls.io.files import check_outputs
    from ldls.segmenters.registry import segmenter_file

    check_outputs({"OUT": [out], "--picture": [picture]}, [image, segmenter_file(segmenter)])
    pixels = read_image(image)
    made = masks_of(pixels, masks=None, segmenter=segmenter, min_score=min_score, categories=categories)
    save(made, out)
    _show(made, pixels, picture)
    console().print(f"wrote {out}", soft_wrap=True)


@app.command(cls=Command)
@speaks_plainly
def show(
    masks: MasksArgument,
    image: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The image they are of.", show_default=False, **EXISTING)
    ] = None,
    picture: MaskPictureOption = None,
    image_id: Annotated[str | None, IMAGE_ID] = None,
    min_score: MinScoreOption = None,
    categories: CategoriesOption = None,
) -> None:
    """Print the masks of a file, and draw them.

    Example: ldls masks show masks/000571.json --image image_2/000571.png --picture masks.png
    """
    from ldls.io import read_image
    from ldls.io.files import check_outputs

    check_outputs({"--picture": [picture]}, [masks, image])
    pixels = None if image is None else read_image(image)
    shown = masks_of(pixels, masks=masks, segmenter=None, image_id=image_id, min_score=min_score, categories=categories)
    _show(shown, pixels, picture)


def _show(masks: InstanceMasks, pixels: np.ndarray | None, picture: Path | None) -> None:
    from ldls.viewing import masks_overlay, save_picture

    console().print(mask_table(masks))
    if picture is not None:
        save_picture(picture, masks_overlay(masks, pixels))
        console().print(f"wrote {picture}", soft_wrap=True)


def mask_table(masks: InstanceMasks) -> Table:
    """Label, name, category, score, pixels and box of each mask."""
    table = Table(title=f"{len(masks)} masks of {masks.height} x {masks.width} pixels (height x width)")
    table.add_column("label", justify="right")
    table.add_column("object")
    for heading in ("category", "score", "pixels", "top, left", "height x width"):
        table.add_column(heading, justify="right")
    for label, mask in enumerate(masks, start=1):
        top, left, height, width = mask.bounding_box
        table.add_row(
            str(label),
            mask.name,
            str(mask.category),
            f"{mask.score:.2f}",
            f"{mask.area:,}",
            f"{top}, {left}" if mask.area else "-",
            f"{height} x {width}" if mask.area else "-",
        )
    return table


def parsed_size(text: str | None) -> tuple[int, int] | None:
    """(height, width) of `HEIGHTxWIDTH`.

    Raises:
        ParameterError: The text is nothing of the kind.
    """
    if text is None:
        return None
    height, _, width = text.lower().partition("x")
    if not (height.strip().isdecimal() and width.strip().isdecimal()):
        raise ParameterError(f"--image-size: got {text!r}, expected HEIGHTxWIDTH such as 375x1242")
    return int(height), int(width)
