"""SemanticKITTI `.label` files: uint32 a point, class in the lower half, instance in the upper."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ldls.errors import CorruptFileError, InputError, TruncatedFileError
from ldls.evaluation.vocabularies import SEMANTIC_KITTI
from ldls.labeling import Labeling

LABEL_BYTES = 4


def read_semantic_kitti(path: str | PathLike[str]) -> Labeling:
    """Labels of a file, one a point in the order of the scan.

    Raises:
        TruncatedFileError: The size is no whole number of labels.
        CorruptFileError: A label has a class that SemanticKITTI does not; the message names the point.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    content = path.read_bytes()
    if len(content) % LABEL_BYTES:
        raise TruncatedFileError(f"{path}: {len(content)} bytes is not a multiple of 4 (uint32 a point)")
    values = np.frombuffer(content, "<u4")
    try:
        return Labeling.from_codes(values & 0xFFFF, SEMANTIC_KITTI, instances=values >> 16)
    except InputError as error:
        raise CorruptFileError(f"{path}: {error}") from None
