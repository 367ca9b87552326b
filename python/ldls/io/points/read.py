"""Point clouds from files: the suffix chooses the format."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from ldls.checks import checked
from ldls.cloud import Points, as_points
from ldls.errors import ParameterError, within
from ldls.io.arrays import read_npy
from ldls.io.files import open_file
from ldls.io.options import of_ending
from ldls.io.points import float_rows, las, pcd, ply, text


def _read_npy(path: Path) -> Points:
    """(N, >= 3) points of an `.npy` file, in its own precision."""
    array = read_npy(path)
    with within(path):
        return as_points(array)


READERS: dict[str, Callable[..., Points]] = {
    ".bin": float_rows.read,
    ".npy": _read_npy,
    ".pcd": pcd.read,
    ".ply": ply.read,
    ".las": las.read,
    ".laz": las.read,
    ".csv": text.read,
    ".txt": text.read,
    ".xyz": text.read,
    ".asc": text.read,
    ".pts": text.read,
}
"""Readers of clouds, by the suffix of the name."""


@checked
def read_points(path: str | PathLike[str], *, columns: int | None = None, recover: bool = False) -> Points:
    """(N, >= 3) float32 or float64 points, x y z first and intensity fourth where there is one, in metres.

    Args:
        path: `.bin` (float32 little-endian rows: KITTI x y z reflectance; nuScenes `.pcd.bin` with a fifth column,
            ring), `.npy`, `.pcd`, `.ply`, `.las` and `.laz`, or text: `.csv`, `.txt`, `.xyz`, `.asc` and `.pts`.
            docs/formats.md has what each may hold.
        columns: Floats a row of a `.bin` file; 4, and 5 for `.pcd.bin`, by default.
        recover: True if a truncated `.bin` yields its whole rows and a warning instead of an error.

    Raises:
        TruncatedFileError: The file ends before its header, or the size of its rows, says.
        CorruptFileError: The file contradicts itself or its format.
        FileFormatError: It is no regular file, or rows of a `.bin` look as if they had another number of columns or
            were not of little-endian float32.
        UnsupportedFormatError: No format has this suffix, or the file is of a variant that cannot be read.
        ParameterError: `columns` or `recover` is given for another format than `.bin`.
        ImportError: The format needs an extra that is not installed; the message names it.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    # what is missing or a folder is told so, whatever its name
    with open_file(path, "cloud"):
        reader = of_ending(path, READERS, "read", "clouds")
    if reader is float_rows.read:
        return reader(path, columns=columns, recover=recover)
    if columns is not None or recover:
        raise ParameterError(f"columns, recover: they are for .bin files alone, got {path.name}; leave them out")
    return reader(path)
