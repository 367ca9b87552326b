"""The interface of a segmenter."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ldls.errors import ParameterError
from ldls.masks import InstanceMasks


class Segmenter(Protocol):
    """Turns an image into instance masks."""

    def __call__(self, image: NDArray[np.uint8]) -> InstanceMasks:
        """The instances of an image (H, W, 3), uint8 RGB."""
        ...


def check_min_score(min_score: float) -> float:
    """`min_score`, the lowest score that is kept.

    Raises:
        ParameterError: It is not from 0 to 1.
    """
    if not 0 <= min_score <= 1:
        raise ParameterError(f"min_score: got {min_score!r}, expected 0 to 1")
    return min_score
