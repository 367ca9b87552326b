"""nuScenes' labels: lidarseg (uint8 a point) and panoptic (uint16 a point, class * 1000 + instance)."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ldls.errors import CorruptFileError, InputError
from ldls.evaluation.vocabularies import NUSCENES
from ldls.io.arrays import read_npz
from ldls.io.nuscenes_labels import INSTANCES_A_CLASS
from ldls.labeling import Labeling


def read_lidarseg(path: str | PathLike[str]) -> Labeling:
    """Labels of a `_lidarseg.bin` file, one a point; there are no instances.

    Raises:
        CorruptFileError: A point has a class above 31; the message names it.
        FileNotFoundError: There is no such file.
    """
    codes = np.frombuffer(Path(path).read_bytes(), np.uint8)
    try:
        return Labeling.from_codes(codes, NUSCENES)
    except InputError as error:
        raise CorruptFileError(f"{path}: {error}; is it a point cloud?") from None


def read_panoptic(path: str | PathLike[str]) -> Labeling:
    """Labels of a `_panoptic.npz` file, one a point.

    Raises:
        CorruptFileError: It is not a whole `.npz` file with one array `data` of such labels.
        FileNotFoundError: There is no such file.
    """
    arrays = read_npz(path)
    labels = arrays.get("data")
    if labels is None or labels.ndim != 1 or labels.dtype.kind not in "iu":
        raise CorruptFileError(f"{path}: found arrays {sorted(arrays)}, expected 'data' with a uint16 a point")
    try:
        return Labeling.from_codes(labels // INSTANCES_A_CLASS, NUSCENES, instances=labels % INSTANCES_A_CLASS)
    except InputError as error:
        raise CorruptFileError(f"{path}: {error}") from None
