"""Segmentations to files: the suffix chooses the format."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ldls.errors import UnsupportedFormatError
from ldls.io import ply, result_npz, semantic_kitti

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation

WRITERS: dict[str, Callable[[Path, Segmentation], None]] = {
    ".npz": result_npz.write,
    ".label": semantic_kitti.write,
    ".ply": ply.write,
}


def write(path: str | PathLike[str], result: Segmentation) -> None:
    """Write `result` in the format of the suffix of `path`.

    Raises:
        UnsupportedFormatError: No format has this suffix.
    """
    path = Path(path)
    if path.suffix not in WRITERS:
        known = ", ".join(WRITERS)
        raise UnsupportedFormatError(f"{path}: cannot write {path.suffix!r} files, expected {known}")
    WRITERS[path.suffix](path, result)
