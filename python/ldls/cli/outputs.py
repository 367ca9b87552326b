"""The files that commands write for one frame."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from ldls.io import save
from ldls.segmentation import Segmentation

PictureOption = Annotated[
    Path | None,
    typer.Option(
        metavar="NAME.png",
        help="Write pictures: NAME.png, the image with masks and points; NAME-birds-eye.png; NAME-comparison.png, "
        "direct projection beside the method.",
        show_default=False,
        dir_okay=False,
    ),
]


class Output(StrEnum):
    """A format of results."""

    NPZ = "npz"
    LABEL = "label"
    PLY = "ply"
    PNG = "png"
    LIDARSEG = "lidarseg"
    PANOPTIC = "panoptic"
    PCD = "pcd"
    LAS = "las"
    LAZ = "laz"
    PARQUET = "parquet"
    CSV = "csv"

    @property
    def ending(self) -> str:
        """Ending of the names of such files."""
        return NUSCENES_ENDINGS.get(self, f".{self}")


NUSCENES_ENDINGS: dict[Output, str] = {Output.LIDARSEG: "_lidarseg.bin", Output.PANOPTIC: "_panoptic.npz"}
DEFAULT_OUTPUTS = (Output.NPZ, Output.LABEL, Output.PLY, Output.PNG)


def write_outputs(
    folder: Path,
    name: str,
    result: Segmentation,
    image: NDArray[np.uint8] | None,
    formats: Sequence[Output],
) -> list[Path]:
    """Write `result` to `folder` in every one of `formats`; the files written."""
    from ldls.viewing import overlay, save_picture

    folder.mkdir(parents=True, exist_ok=True)
    paths = {output: folder / f"{name}{output.ending}" for output in formats}
    for output, path in paths.items():
        if output is Output.PNG:
            save_picture(path, overlay(result, image))
        else:
            save(result, path)
    return list(paths.values())
