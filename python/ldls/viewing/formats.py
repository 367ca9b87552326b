"""The files of a frame's result, and the words that choose them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.checks import did_you_mean
from ldls.errors import ParameterError
from ldls.io import save
from ldls.io.results import FORMATS
from ldls.segmentation import Segmentation
from ldls.viewing.files import save_picture
from ldls.viewing.overlay import overlay

BAG = "bag"
"""The labelled ROS bag of a whole run."""
TRACKS = "tracks"
"""The objects numbered over a whole run: the folder of their files, and the word that a journal notes them by."""
PICTURE = "png"
"""The image with masks and points."""
RESULT = "npz"
"""The file that a whole result is read from, to write others."""
ENDINGS: dict[str, str] = {**{word: each.ending for word, each in FORMATS.items()}, PICTURE: ".png"}
"""Endings of the names of files, by the words that choose them."""


def check_formats(formats: Sequence[str], *, of_run: bool = False) -> None:
    """Refuse words that choose no file.

    Args:
        formats: The words.
        of_run: True if files of a whole run may be among them.

    Raises:
        ParameterError: There is such a word, or none at all.
    """
    if not formats:
        raise ParameterError("formats: expected at least one, as label")
    known = [*ENDINGS, BAG] if of_run else [*ENDINGS]
    for word in formats:
        if word == BAG and not of_run:
            raise ParameterError(f"formats: {BAG} is of a whole run; label the ROS bag with `ldls run`")
        if word not in known:
            expected = f"expected some of {', '.join(known)}{did_you_mean(word, known)}"
            raise ParameterError(f"formats: {word!r} is unknown; {expected}")


def file_name(frame: str, word: str) -> str:
    """Name of a file of a frame: 000001.label, 000001_lidarseg.bin."""
    return frame + ENDINGS[word]


def file_names(frame: str) -> frozenset[str]:
    """Names of all files that a frame can have."""
    return frozenset(frame + ending for ending in ENDINGS.values())


def write_formats(
    result: Segmentation, folder: Path, frame: str, formats: Sequence[str], images: Sequence[NDArray[np.uint8] | None]
) -> list[Path]:
    """Write the files of a frame to `folder`, each whole; `images` are those of the views, for the picture."""

    def write(word: str) -> Path:
        path = folder / file_name(frame, word)
        if word == PICTURE:
            save_picture(path, overlay(result, images))
        else:
            save(result, path)
        return path

    # the picture takes longest
    in_turn = sorted(formats, key=lambda word: word != PICTURE)
    with ThreadPoolExecutor(2) as threads:
        written = dict(zip(in_turn, threads.map(write, in_turn), strict=True))
    return [written[word] for word in formats]
