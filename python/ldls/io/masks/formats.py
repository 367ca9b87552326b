"""Files of instance masks: the suffix chooses the format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from ldls.checks import checked
from ldls.errors import MaskError, UnsupportedFormatError, within
from ldls.io.files import read_lines
from ldls.io.masks import instance_png, json_file, kitti_boxes, npz, numpy_stack, png_folder, yolo_txt
from ldls.io.options import check_options, of_ending
from ldls.masks import InstanceMasks
from ldls.masks.pixels import check_same_size, checked_size


def _read_txt(
    path: str | PathLike[str], *, image_size: tuple[int, int] | None = None, names: Mapping[int, str] | None = None
) -> InstanceMasks:
    """The masks of a text file: lines of YOLO begin with numbers, those of KITTI's label_2 with names.

    Raises:
        MaskError: No image size, which the file does not say.
    """
    reader = yolo_txt.read if yolo_txt.is_yolo(read_lines(path, "mask file")) else kitti_boxes.read
    if image_size is None:
        raise MaskError(f"{path}: says nothing of the image's size; give its image_size=(height, width)")
    return reader(path, image_size=image_size, names=names)


READERS: dict[str, Callable[..., InstanceMasks]] = {
    ".json": json_file.read,
    ".png": instance_png.read,
    ".npz": npz.read,
    ".npy": numpy_stack.read,
    ".txt": _read_txt,
}

WRITERS: dict[str, Callable[..., None]] = {
    ".json": json_file.write,
    ".png": instance_png.write,
    ".npz": npz.write,
    ".npy": numpy_stack.write,
}


@checked
def read_masks(
    path: str | PathLike[str],
    *,
    image_size: tuple[int, int] | None = None,
    image_id: int | str | None = None,
    instance_axis: int | None = None,
    class_divisor: int | None = None,
    categories: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
) -> InstanceMasks:
    """Instance masks of a file; its suffix tells the format.

    Args:
        path: `.json` (COCO, COCO panoptic beside its PNG, polygons of labelme, Cityscapes or Mapillary, Segment
            Anything), `.png` (instance numbers; those of Cityscapes by the name _instanceIds.png), `.npz` (of ldls, or
            of the LDLS research code), `.npy` (stack of masks), `.txt` (polygons of YOLO, or KITTI label_2, whose boxes
            become masks), or a folder of one PNG an instance.
        image_size: (height, width) in pixels; `.txt` needs it, and others must agree with it.
        image_id: Which image of a `.json` with several.
        instance_axis: Axis of a `.npy` that counts the masks, 0 or -1, where sizes do not tell.
        class_divisor: For a `.png` whose numbers hold the class as well: 256 for KITTI's, 1000 for KITTI-360's.
        categories: Category ids for a `.png` or `.npy`, which are all 1, "object", without them.
        scores: Scores for a `.png` or `.npy`, which are all 1 without them.
        names: Name of each category id, for all but `.npz`, where the file does not say.

    Raises:
        MaskError: Masks that cannot be used, or of another size than the image.
        UnsupportedFormatError: No format has this suffix, or this variant is not supported.
        ParameterError: The format has no such option.
        FileFormatError: The file is broken.
        LimitError: The file is too large.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    is_folder = path.is_dir() and path.suffix.lower() not in READERS
    if path.suffix.lower() == ".xml" and not is_folder:
        raise UnsupportedFormatError(f"{path}: cannot read masks of CVAT, export COCO 1.0")
    reader: Callable[..., InstanceMasks] = png_folder.read if is_folder else of_ending(path, READERS, "read", "masks")
    options = {
        "image_id": image_id,
        "instance_axis": instance_axis,
        "class_divisor": class_divisor,
        "categories": categories,
        "scores": scores,
        "names": names,
    }
    given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    known = check_options(f"{path.suffix} masks ({path})", reader, given)
    if image_size is None:
        return reader(path, **given)
    size = checked_size(image_size)
    masks = reader(path, **given, **({"image_size": size} if "image_size" in known else {}))
    with within(path):
        check_same_size(masks.image_size, size)
    return masks
