"""What a file or another program says of the masks of one image, before it is checked as a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from numpy.typing import ArrayLike

from ldls import _ldls
from ldls.categories import COCO_NAMES


@dataclass(frozen=True, kw_only=True)
class MaskRecords:
    """The instances of one image.

    Attributes:
        size: (height, width) of the image in pixels.
        rles: Their pixels.
        categories: Category id of each.
        scores: Score of each, 0 to 1.
        names: Name of each category id.
    """

    size: tuple[int, int]
    rles: Sequence[_ldls.Rle]
    categories: ArrayLike
    scores: ArrayLike
    names: Mapping[int, str] = field(default_factory=lambda: dict(COCO_NAMES))
