"""SqueezeSeg's range images: `.npy`, 64 x 512 x 6 of x y z intensity range label."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, InputError
from ldls.io.arrays import read_npy
from ldls.labeling import BACKGROUND, Labeling

SQUEEZESEG: dict[int, str] = {0: BACKGROUND, 1: "car", 2: "pedestrian", 3: "cyclist"}
"""Classes by their numbers."""
IMAGE = (64, 512)
N_CHANNELS = 6
RANGE, LABEL = 4, 5


def read_squeezeseg(path: str | PathLike[str]) -> Labeling:
    """Labels of the 32,768 pixels, row by row; those without a range are ignored, and there are no instances.

    The file is a range image, or the (64, 512) labels alone, as a network predicts them.

    Raises:
        CorruptFileError: It is no file of such an array, or a label is none of 0 to 3.
        TruncatedFileError: It ends before its array does.
        UnsafeFileError: It holds Python objects.
        FileNotFoundError: There is no such file.
    """
    image = _load(path)
    labels = image.reshape(-1) if image.ndim == 2 else image[:, :, LABEL].reshape(-1)
    counts = np.ones(labels.shape, bool) if image.ndim == 2 else image[:, :, RANGE].reshape(-1) > 0
    # what a pixel without a return holds means nothing
    try:
        return Labeling.from_codes(np.where(counts, labels, 0), SQUEEZESEG).restricted(counts)
    except InputError as error:
        raise CorruptFileError(f"{path}: {error}") from None


def read_squeezeseg_ranges(path: str | PathLike[str]) -> NDArray[np.float64] | None:
    """(32768,) distances of the pixels from the lidar in metres; None where the file holds labels alone.

    Raises:
        FileFormatError: It is not a whole file of such an array.
    """
    image = _load(path)
    with np.errstate(invalid="ignore"):  # NaNs that signal
        return None if image.ndim == 2 else image[:, :, RANGE].reshape(-1).astype(np.float64)


def _load(path: str | PathLike[str]) -> NDArray[Any]:
    array = read_npy(path)
    if array.shape not in ((*IMAGE, N_CHANNELS), IMAGE):
        raise CorruptFileError(f"{path}: expected 64 x 512 x 6, or 64 x 512 labels, got {array.shape}")
    if array.dtype.kind not in "fiu":
        raise CorruptFileError(f"{path}: expected numbers, got {array.dtype}")
    return array
