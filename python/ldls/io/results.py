"""Segmentations, maps and masks to files: the ending of the name chooses the format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from ldls.checks import checked
from ldls.errors import UnsupportedFormatError
from ldls.io import result_npz, tables
from ldls.io.labels import kitti_objects, nuscenes_labels, semantic_kitti
from ldls.io.masks.formats import WRITERS as MASK_WRITERS
from ldls.io.options import check_options, of_ending
from ldls.io.points import las, pcd, ply
from ldls.masks import InstanceMasks
from ldls.segmentation import Segmentation
from ldls.sequences import LabelledMap


class Format(NamedTuple):
    """A format of results: the ending of its files' names, and their writer."""

    ending: str
    write: Callable[[Path, Segmentation], None]


FORMATS: dict[str, Format] = {
    "npz": Format(".npz", result_npz.write),
    "label": Format(".label", semantic_kitti.write),
    "ply": Format(".ply", ply.write),
    "lidarseg": Format("_lidarseg.bin", nuscenes_labels.write_lidarseg),
    "panoptic": Format("_panoptic.npz", nuscenes_labels.write_panoptic),
    "pcd": Format(".pcd", pcd.write),
    "las": Format(".las", las.write),
    "laz": Format(".laz", las.write),
    "parquet": Format(".parquet", tables.write_parquet),
    "csv": Format(".csv", tables.write_csv),
    "kitti-boxes": Format(".txt", kitti_objects.write),
}
"""Formats of results, by the words that choose them on the command line."""
MAP_WRITERS: dict[str, Callable[[Path, LabelledMap], None]] = {
    ".ply": ply.write,
    ".pcd": pcd.write,
    ".las": las.write,
    ".laz": las.write,
}
"""Writers of maps by the ending of the name."""
WRITERS: dict[str, tuple[type, Mapping[str, Callable[..., None]]]] = {
    "results": (Segmentation, dict(FORMATS.values())),
    "maps": (LabelledMap, MAP_WRITERS),
    "masks": (InstanceMasks, MASK_WRITERS),
}
"""What is written, and by what, by the ending of the name."""


@checked
def read_result(path: str | PathLike[str]) -> Segmentation:
    """The whole result that `save` wrote to an `.npz` file.

    Raises:
        UnsupportedFormatError: It is no such file, or one of a version that did not store the points.
        CorruptFileError: It is not whole, or its arrays do not fit one another.
        FileNotFoundError: There is no such file.
    """
    if Path(path).suffix.lower() != ".npz" and Path(path).is_file():
        raise UnsupportedFormatError(
            f"{path}: expected the .npz of a result, which has its points, masks and cameras; `ldls run` and "
            "`ldls segment` write it beside the other formats (--formats npz)"
        )
    return result_npz.read(path)


@checked
def save(thing: Segmentation | InstanceMasks | LabelledMap, path: str | PathLike[str], **options: Any) -> None:  # noqa: ANN401
    """Write a result, a map or instance masks; the ending of the name chooses the format.

    Of a result, `.npz` has everything, `.label` is SemanticKITTI's, `_lidarseg.bin` and `_panoptic.npz` are nuScenes',
    `.txt` is KITTI's label_2 with a line an object. `.ply`, `.pcd`, `.las` and `.laz` are point clouds with labels,
    confidence and colour; `.parquet` and `.csv` tables with a row a point; `save_objects` writes tables with a row an
    object. docs/formats.md says what is in each. Of a map, the point clouds. Of masks, `.json` is COCO's, `.png` has
    instance numbers (for masks that do not overlap), `.npz` run lengths and `.npy` pixels only. The file appears only
    when it is whole.

    Args:
        thing: What `ldls.segment` returns, a `LabelledMap`, or instance masks.
        path: The file.
        options: Of masks: `image_id`, `file_name` and `results` of `.json`, `layout` of `.npz`, `pixels_only` of
            `.npy`.

    Raises:
        UnsupportedFormatError: No format has this ending.
        LimitError: The format cannot hold so many instances, so wide a cloud or so large a category id.
        NonFiniteError: The format cannot hold points that are not finite.
        MaskError: The format cannot keep these masks.
        ParameterError: The format has no such option.
        InputError: It is neither a result nor a map nor masks, or a result of several cameras to `.txt`.
        ImportError: The format needs an extra that is not installed; the message names it.
    """
    path = Path(path)
    what, writers = next((what, writers) for what, (kind, writers) in WRITERS.items() if isinstance(thing, kind))
    writer = of_ending(path, writers, "write", what)
    check_options(f"{path.suffix} {what} ({path})", writer, options)
    writer(path, thing, **options)
