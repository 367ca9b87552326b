"""The files of one frame, as commands take them: a lidar sweep, a KITTI calibration and instance masks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from ldls.io import read_camera, read_points
from ldls.label_diffusion import segment
from ldls.masks import InstanceMasks
from ldls.params import Params
from ldls.segmentation import Segmentation

EXISTING: dict[str, Any] = {"exists": True, "dir_okay": False, "readable": True}
POINTS = typer.Option(help="Lidar sweep: .bin, .npy, .pcd, .ply, .las, .laz, .csv, .txt or .xyz.", **EXISTING)
CALIB = typer.Option(help="KITTI calibration of the frame.", **EXISTING)
MASKS = typer.Option(
    help="Instance masks: COCO .json, .npz of ldls or the LDLS research code, instance .png, .npy stack, or "
    "KITTI label_2 .txt.",
    show_default=False,
    **EXISTING,
)
IMAGE_ID = typer.Option(help="Which image of a COCO file that holds several.")
COLOUR_CAMERA = 2
"""KITTI's left colour camera."""


def segment_files(points: Path, masks: InstanceMasks, calib: Path, *, camera: int, params: Params) -> Segmentation:
    """The labels of the points of a sweep by the masks of the image of one of the cameras of a KITTI calibration."""
    return segment(read_points(points), masks, read_camera(calib, camera=camera), params=params)
