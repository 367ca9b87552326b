"""Segmentations to files: the ending of the name chooses the format."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ldls.errors import UnsupportedFormatError
from ldls.io import csv, las, nuscenes_labels, parquet, pcd, ply, result_npz, semantic_kitti

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation

WRITERS: dict[str, Callable[[Path, Segmentation], None]] = {
    ".npz": result_npz.write,
    ".label": semantic_kitti.write,
    ".ply": ply.write,
    "_lidarseg.bin": nuscenes_labels.write_lidarseg,
    "_panoptic.npz": nuscenes_labels.write_panoptic,
    ".pcd": pcd.write,
    ".las": las.write,
    ".laz": las.write,
    ".parquet": parquet.write,
    ".csv": csv.write,
}
"""What writes a segmentation, by the ending of the name."""


def write(path: str | PathLike[str], result: Segmentation) -> None:
    """Write `result` in the format of the longest ending that the name of `path` has.

    Raises:
        UnsupportedFormatError: No format has this ending.
    """
    path = Path(path)
    found = [ending for ending in WRITERS if path.name.lower().endswith(ending)]
    if not found:
        known = ", ".join(WRITERS)
        raise UnsupportedFormatError(f"{path}: cannot write {path.suffix!r} files, expected {known}")
    WRITERS[max(found, key=len)](path, result)
