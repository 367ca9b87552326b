"""Text files of masks: YOLO's polygons, or KITTI's boxes."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

from ldls.errors import MaskError
from ldls.io.files import read_lines
from ldls.io.masks import kitti_boxes, yolo_txt
from ldls.masks import InstanceMasks


def read(
    path: str | PathLike[str], *, image_size: tuple[int, int] | None = None, names: Mapping[int, str] | None = None
) -> InstanceMasks:
    """The masks of a file: lines of YOLO begin with numbers, those of KITTI's label_2 with names.

    Raises:
        MaskError: No image size, which the file does not say.
    """
    reader = yolo_txt.read if yolo_txt.is_yolo(read_lines(path, "mask file")) else kitti_boxes.read
    if image_size is None:
        raise MaskError(f"{path}: says nothing of the image's size; give its image_size=(height, width)")
    return reader(path, image_size=image_size, names=names)
