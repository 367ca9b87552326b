"""Discs set on a picture at many places at once."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from ldls.palette import Colour

Canvas = NDArray[np.uint8]
"""(H, W, 3) red, green and blue of a picture that is drawn on."""
Opacity = NDArray[np.float64]
"""(2 r + 1, 2 r + 1) how much of what is beneath a mark covers, 0 to 1."""


def disc(radius_px: float, opacity: float = 1.0) -> Opacity:
    """A smooth disc in the middle of an odd square."""
    reach = ceil(radius_px + 0.5)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(opacity * (radius_px + 0.5 - np.hypot(x, y)).clip(0, 1))


def stamp(canvas: Canvas, at_px: NDArray[np.int64], colours: NDArray[np.uint8] | Colour, mark: Opacity) -> None:
    """Set `mark` on the canvas around every one of `at_px` (n, 2), x and y, each in its colour (n, 3) or all in one.

    Later ones lie above earlier ones; what reaches over the edge is cut off.
    """
    reach = mark.shape[0] // 2
    height, width = canvas.shape[:2]
    own = np.broadcast_to(np.asarray(colours, np.uint8), (len(at_px), 3))
    # the faintest pixels of the mark first, so that no rim covers the middle of a neighbour
    for at in np.argsort(mark, axis=None):
        dy, dx = divmod(int(at), mark.shape[1])
        opacity = mark[dy, dx]
        if opacity == 0:
            continue
        x, y = at_px[:, 0] + dx - reach, at_px[:, 1] + dy - reach
        inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
        x, y = x[inside], y[inside]
        canvas[y, x] = np.round((1 - opacity) * canvas[y, x] + opacity * own[inside])
