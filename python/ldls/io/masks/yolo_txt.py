"""Polygons of YOLO: a line an instance, the class and x y of each corner as shares of width and height.

A network's results may have the score behind the corners, and those of `yolo track` the number of a track behind that.
Source: https://docs.ultralytics.com/datasets/segment/, and `Results.save_txt` of Ultralytics 8.4.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS, category_ids, is_object
from ldls.checks.values import number_of
from ldls.errors import CorruptFileError, LdlsWarning, MaskError
from ldls.io.cameras.field_file import read_fields
from ldls.io.files import read_lines
from ldls.masks import InstanceMasks

CLASSES, DATA = "classes.txt", "data.yaml"
"""Files of class names: of labelling tools, a line each, and of ultralytics."""
NUMBER = re.compile(r"[-+]?\d+(\.\d*)?")
"""The class of a line, as it is or as it may have become."""
FAR = 0.1
"""Share of the image from which on a corner does not go on where the last one was."""
LONGEST_LINE = 0.01
"""Share of the image up to which two corners are taken for an outline."""
STRAIGHT_PX = 0.05
"""How far two corners may be from a line of pixels, across, down or diagonal, by the rounding of what is written."""
CONTIGUOUS_NAMES = {index: COCO_NAMES[category] for index, category in enumerate(CONTIGUOUS_IDS)}


def is_yolo(lines: Sequence[str]) -> bool:
    """True for lines of which the first begins with a number; KITTI's begin with a name."""
    first = next((line.split()[0] for line in lines if line.strip()), "")
    return NUMBER.fullmatch(first) is not None


def read(path: str | PathLike[str], *, image_size: tuple[int, int], names: Mapping[int, str] | None) -> InstanceMasks:
    """One mask for each line, but none for those of a class that is named background.

    A line without a corner, or with one, and among polygons one with two that lie close together, is an instance
    without a pixel: it is too small for an outline.

    Args:
        path: `.txt` file.
        image_size: (height, width) of the image in pixels.
        names: Name of each class by its number. Without them those of a data.yaml or classes.txt in the folder of the
            file or one of the two above it, and else COCO's 80. Names of COCO get COCO's ids, others 100 and the
            number.

    Raises:
        MaskError: Boxes instead of polygons, or a class without a name.
        CorruptFileError: A line that is none of YOLO's.
    """
    if names is None:
        names = _names_beside(Path(path)) or CONTIGUOUS_NAMES
    ids, names_of_ids = category_ids(names)
    numbered = enumerate(read_lines(path, "polygons"), start=1)
    lines = [Line.of(f"{path}, line {number}", line.split()) for number, line in numbered if line.strip()]
    tracked = _are_tracked(lines)
    outlines = [line.outline(tracked) for line in lines]
    of_polygons = any(len(corners) > 2 for corners, _ in outlines)
    rles, categories, scores = [], [], []
    for line, (corners, score) in zip(lines, outlines, strict=True):
        _check_outline(line.place, corners, score, image_size if of_polygons else None)
        if line.category not in ids:
            example = f"names={{{line.category}: '...'}}"
            raise MaskError(
                f"{line.place}: class {line.category} has no name; pass {example}, all of those in data.yaml"
            )
        if not is_object(names[line.category]):
            continue
        rles.append(_pixels(corners, image_size))
        categories.append(ids[line.category])
        scores.append(min(max(score, 0.0), 1.0))
    return InstanceMasks(
        rles, image_size, categories=np.array(categories, np.int64), scores=scores, names=COCO_NAMES | names_of_ids
    )


def _names_beside(path: Path) -> dict[int, str]:
    """The names of the classes that the nearest file of names has; none where there is no such file."""
    for folder in path.absolute().parents[:3]:
        if (folder / CLASSES).is_file():
            return dict(enumerate(line.strip() for line in read_lines(folder / CLASSES, "class names")))
        if (folder / DATA).is_file():
            return _names_in(folder / DATA)
    return {}


def _names_in(path: Path) -> dict[int, str]:
    """The names of a data.yaml: a list, or a mapping from number."""
    found = read_fields(path).find("names")
    names = dict(enumerate(found)) if isinstance(found, list) else found
    if not isinstance(names, dict) or not all(type(key) is int for key in names):
        raise CorruptFileError(f"{path}: names: expected a list, or numbers with names")
    return {key: str(name) for key, name in names.items()}


@dataclass(frozen=True, eq=False)
class Line:
    """An instance: the class, and as words and numbers what follows it."""

    place: str
    category: int
    words: list[str]
    numbers: NDArray[np.float64]

    @classmethod
    def of(cls, place: str, words: list[str]) -> Line:
        """The line of these words.

        Raises:
            CorruptFileError: They are no class and numbers.
        """
        if not words[0].isdecimal():
            raise CorruptFileError(f"{place}: class is {words[0][:60]!r}, expected a whole number, counted from 0")
        try:
            return cls(place, int(words[0]), words[1:], np.array([number_of(word) for word in words[1:]], np.float64))
        except ValueError:
            raise CorruptFileError(f"{place}: expected a class and numbers, got {' '.join(words)[:60]!r}") from None

    def outline(self, tracked: bool) -> tuple[NDArray[np.float64], float]:
        """(n, 2) x, y of the corners as shares, and the score; of a `tracked` one the last number is left out."""
        numbers = self.numbers[:-1] if tracked else self.numbers
        corners, score = (numbers[:-1], float(numbers[-1])) if len(numbers) % 2 else (numbers, 1.0)
        return corners.reshape(-1, 2), score


def _are_tracked(lines: Sequence[Line]) -> bool:
    """True if every line ends with the number of a track, behind shares.

    Numbers of tracks are whole, from 1 on, each there once, and written without a point. A corner or score may be
    written as 1 too, so that one above 1 must be among them; a warning says where a 1 may be either.
    """
    last = [line.words[-1] if line.words else "" for line in lines]
    whole = all(word.isdecimal() and word[0] != "0" for word in last)
    whole = whole and all(_are_shares(line.numbers[:-1]) for line in lines)
    if not whole or len(set(last)) < len(last) or len({len(line.words) % 2 for line in lines}) != 1:
        return False
    if last == ["1"]:
        _warn_of_a_track(lines[0])
    return last != ["1"]


def _warn_of_a_track(line: Line) -> None:
    """Warn of a last corner far from its neighbours, at the lower edge of the image, that nothing else touches."""
    corners, _ = line.outline(tracked=False)
    # a score before a 1 is a score, whatever the 1 is
    if len(line.words) % 2 or len(corners) < 3 or (corners[:-1, 1] > 0.999).any():
        return
    if np.abs(corners[[0, -2]] - corners[-1]).max(axis=1).min() < FAR:
        return
    pair = " ".join(line.words[-2:])
    warnings.warn(
        f"{line.place}: {pair} is taken for a corner; if it is a score and the number of a track, save without scores "
        "(save_conf=False), so that numbers of tracks can be told",
        LdlsWarning,
        stacklevel=7,
    )


def _check_outline(place: str, corners: NDArray[np.float64], score: float, image_size: tuple[int, int] | None) -> None:
    """Refuse boxes, and what are no shares; with the `image_size` of a file of polygons two corners may be a line."""
    if len(corners) == 2 and (image_size is None or not _is_line_of_pixels(corners, image_size)):
        raise MaskError(
            f"{place}: a box, expected a polygon of three corners or more; segment with a -seg model, or pass the "
            "boxes to InstanceMasks.from_boxes"
        )
    if not _are_shares(np.append(corners, score)):
        raise CorruptFileError(
            f"{place}: expected a class and x y of three corners or more, as shares of the image from 0 to 1"
        )


def _are_shares(numbers: NDArray[np.float64]) -> bool:
    return bool(((numbers >= -1e-6) & (numbers <= 1 + 1e-6)).all())


def _is_line_of_pixels(corners: NDArray[np.float64], image_size: tuple[int, int]) -> bool:
    """True for two corners (2, 2) that may be a whole outline; those of a box are its centre and its sides."""
    apart = np.abs(corners[1] - corners[0])
    across, down = apart * image_size[::-1]
    return bool(apart.max() <= LONGEST_LINE and min(across, down, abs(across - down)) < STRAIGHT_PX)


def _pixels(corners: NDArray[np.float64], image_size: tuple[int, int]) -> _ldls.Rle:
    if len(corners) < 3:  # of an instance of a pixel or two, as the network sees the image
        return _ldls.Rle.from_runs(*image_size, np.array([image_size[0] * image_size[1]], np.uint32))
    # shares count from the outer edges of the image, as COCO's polygons do
    return _ldls.Rle.from_polygons(*image_size, [(corners * image_size[::-1]).ravel().tolist()])
