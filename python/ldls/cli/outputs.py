"""The files that commands write for one frame."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.io.whole_file import whole_file
from ldls.masks import InstanceMasks
from ldls.segmentation import Segmentation

CANVAS = (38, 38, 42)
"""Colour behind masks and points where there is no image."""


class Output(StrEnum):
    """What a command can write."""

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
        """How the names of such files end."""
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
    folder.mkdir(parents=True, exist_ok=True)
    paths = {output: folder / f"{name}{output.ending}" for output in formats}
    for output, path in paths.items():
        if output is Output.PNG:
            _write_picture(path, result, image)
        else:
            result.save(path)
    return list(paths.values())


def _write_picture(path: Path, result: Segmentation, image: NDArray[np.uint8] | None) -> None:
    picture = picture_of(result.masks, image, result.pixels, result.labels[result.in_view])
    with whole_file(path) as file:
        picture.save(file, "PNG")


def picture_of(
    masks: InstanceMasks,
    image: NDArray[np.uint8] | None,
    uv_px: NDArray[np.floating],
    labels: NDArray[np.int32],
) -> Image.Image:
    """The image, or a dark canvas, with masks and labelled points on it."""
    from ldls.viewing import overlay

    if image is None:
        image = np.full((*masks.image_size, 3), CANVAS, np.uint8)
    crops = ((*mask.bounding_box[:2], mask.crop()) for mask in masks)
    names = [f"{mask.name} {mask.score:.2f}" for mask in masks]
    return overlay(image, crops, uv_px, labels, names, masks.categories.tolist())
