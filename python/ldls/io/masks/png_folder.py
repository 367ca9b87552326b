"""A folder of one PNG an instance, as Segment Anything's script writes it: black, and white where the instance is."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ldls.errors import MaskError, within
from ldls.io.images import read_image
from ldls.masks import InstanceMasks


def read(
    path: str | PathLike[str],
    *,
    categories: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
) -> InstanceMasks:
    """The masks of all PNG of a folder in the order of their names, numbers by their value.

    Args:
        path: Folder.
        categories: (M,) category ids; without them all are category 1, "object".
        scores: (M,) scores from 0 to 1; all 1 without them.
        names: Name of each category id.

    Raises:
        MaskError: There is no PNG, or they are of different sizes or no masks.
    """
    files = sorted(Path(path).glob("*.png"), key=lambda file: (len(file.stem), file.stem))
    if not files:
        raise MaskError(f"{path}: a folder without .png, expected one an instance")
    with within(path):
        # one at a time: only run lengths are kept
        pixels = (np.asarray(read_image(file)).max(axis=-1) > 127 for file in files)
        return InstanceMasks.from_array(pixels, categories=categories, scores=scores, names=names)
