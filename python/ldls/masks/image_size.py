"""The size of an image, (height, width) in pixels."""

from __future__ import annotations

import numpy as np

from ldls.errors import MaskError


def checked_size(size: object) -> tuple[int, int]:
    """`size` as two ints.

    Raises:
        MaskError: It is no pair of whole numbers from 1 to 2**31 - 1.
    """
    pair = tuple(size) if isinstance(size, list | tuple) else ()
    whole = all(isinstance(side, int | np.integer) and not isinstance(side, bool) for side in pair)
    if len(pair) != 2 or not whole or not all(0 < side < 2**31 for side in pair):
        raise MaskError(f"size is {size!r}, expected (height, width) in whole pixels")
    return int(pair[0]), int(pair[1])
