"""What a file or another program says of the masks of one image, before it is checked as a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from ldls import _ldls


@dataclass(frozen=True, kw_only=True)
class MaskRecords:
    """The instances of one image.

    Attributes:
        source: Where they come from, for messages.
        size: (height, width) of the image in pixels.
        rles: Their pixels.
        categories: Category id of each; None where there are none.
        scores: Score of each, 0 to 1; None where there are none.
        names: Name of each category id; None where there are none.
    """

    source: str
    size: tuple[int, int]
    rles: Sequence[_ldls.Rle]
    categories: ArrayLike | None = None
    scores: ArrayLike | None = None
    names: Mapping[int, str] | None = None
