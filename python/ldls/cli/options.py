"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ldls.errors import ParameterError

OutOption = Annotated[
    Path, typer.Option(metavar="FOLDER", help="Folder for the results; made if need be.", file_okay=False)
]
FormatsOption = Annotated[
    str,
    typer.Option(
        metavar="WORDS",
        help="Files to write for each frame: npz (all fields), label (SemanticKITTI), lidarseg, panoptic (nuScenes), "
        "ply, pcd, las, laz (coloured clouds), parquet, csv (a row a point), kitti-boxes (label_2), png (picture); of "
        "a run over a ROS bag also bag (one labelled bag).",
    ),
]
CoresOption = Annotated[int | None, typer.Option(metavar="N", min=1, help="Cores to use.", show_default="all")]
ObjectsOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Table of the objects, a row each: .csv, or .json after COCO's data sets, with boxes in the lidar frame.",
        show_default=False,
        dir_okay=False,
    ),
]
PictureOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.png",
        help="Write pictures: FILE.png, the image with masks and points; FILE-birds-eye.png; FILE-comparison.png, "
        "direct projection beside the method.",
        show_default=False,
        dir_okay=False,
    ),
]


class SuitePart(StrEnum):
    """Parts of the simulated suite."""

    VALIDATION = "validation"
    TUNING = "tuning"


FRAMES_FAILED = 2
"""Exit status where frames failed and the rest is done."""
STOPPED = 130
"""Exit status after Ctrl-C, as of other programs."""


def words(text: str) -> tuple[str, ...]:
    """The words of a list separated by commas, without the blanks around them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def refuse(options: Mapping[str, object], why: str) -> None:
    """Refuse options, by their names, that were given and have no place here.

    Raises:
        ParameterError: One was.
    """
    for name, value in options.items():
        if value is not None:
            raise ParameterError(f"--{name}: {why}; leave it out")
