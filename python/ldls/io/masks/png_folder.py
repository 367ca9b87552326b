"""A folder of one PNG an instance, as Segment Anything's script writes it: black, and white where the instance is."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ldls.checks.values import number_of
from ldls.errors import MaskError, within
from ldls.io.files import open_file
from ldls.io.images import read_image
from ldls.io.names import is_hidden, name_order
from ldls.masks import InstanceMasks

METADATA = "metadata.csv"
MAX_BYTES = 1 << 24


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
        scores: (M,) scores from 0 to 1; without them `predicted_iou` of the script's metadata.csv, or all 1.
        names: Name of each category id.

    Raises:
        MaskError: There is no PNG, or they are of different sizes or no masks, or metadata.csv is of others.
    """
    found = (file for file in Path(path).glob("*.png") if not is_hidden(file.name))
    files = sorted(found, key=lambda file: name_order(file.stem))
    if not files:
        raise MaskError(f"{path}: a folder without .png, expected one an instance")
    if scores is None and (Path(path) / METADATA).is_file():
        scores = _scores(Path(path) / METADATA, [file.stem for file in files])
    with within(path):
        # one at a time: only run lengths are kept
        pixels = (np.asarray(read_image(file)).max(axis=-1) > 127 for file in files)
        return InstanceMasks.from_array(pixels, categories=categories, scores=scores, names=names)


def _scores(path: Path, stems: Sequence[str]) -> list[float]:
    """The predicted IoU of each mask; those of the network may lie a little above 1."""
    with open_file(path, "text file", limit=MAX_BYTES) as file:
        rows = {row["id"]: row for row in csv.DictReader(file.text().splitlines())}
        missing = [stem for stem in stems if stem not in rows]
        if missing:
            raise MaskError(f"has no row of {missing[0]}.png; delete it, or give scores=")
        return [min(number_of(rows[stem]["predicted_iou"]), 1.0) for stem in stems]
