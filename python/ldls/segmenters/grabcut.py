"""Outlines of objects within boxes, by OpenCV's GrabCut."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require

MARGIN = 0.25
"""Share of a box that is looked at on each side of it, as a sample of the background."""
MIN_MARGIN_PX = 8
MAX_PIXELS = 65_536
"""Larger surroundings are shrunk to this many pixels; GrabCut takes time in proportion."""
MIN_SHARE = 0.2
"""Share of a box: if GrabCut leaves less, the ellipse in the box takes its place."""
ROUNDS = 5
SEED = 0


def cut(image: NDArray[np.uint8], top: int, left: int, height: int, width: int) -> NDArray[np.bool_]:
    """(height, width) pixels of the object in a box that lies within `image` (H, W, 3); the same every time.

    Rother, Kolmogorov and Blake, "GrabCut", 2004.

    Raises:
        ImportError: `ldls[grabcut]` is not installed.
    """
    rows = _widened(top, height, image.shape[0])
    columns = _widened(left, width, image.shape[1])
    surroundings = image[rows, columns]
    foreground = _foreground(surroundings, (top - rows.start, left - columns.start, height, width))
    if np.count_nonzero(foreground) < MIN_SHARE * height * width:
        return ellipse(height, width)
    return foreground


def ellipse(height: int, width: int) -> NDArray[np.bool_]:
    """(height, width) pixels whose centres lie in the ellipse that touches the box."""
    down = (np.arange(height) + 0.5) / height * 2 - 1
    across = (np.arange(width) + 0.5) / width * 2 - 1
    inside: NDArray[np.bool_] = down[:, None] ** 2 + across**2 <= 1
    return inside


def _widened(start: int, length: int, limit: int) -> slice:
    margin = max(MIN_MARGIN_PX, math.ceil(MARGIN * length))
    return slice(max(start - margin, 0), min(start + length + margin, limit))


def _foreground(surroundings: NDArray[np.uint8], box: tuple[int, int, int, int]) -> NDArray[np.bool_]:
    cv2 = require("cv2", "grabcut")
    top, left, height, width = box
    scale = min(1.0, math.sqrt(MAX_PIXELS / (surroundings.shape[0] * surroundings.shape[1])))
    size = tuple(max(round(side * scale), 1) for side in surroundings.shape[:2])
    small = cv2.resize(surroundings, size[::-1], interpolation=cv2.INTER_AREA)
    marks = np.full(size, cv2.GC_BGD, np.uint8)
    inner = (
        slice(math.floor(top * scale), math.ceil((top + height) * scale)),
        slice(math.floor(left * scale), math.ceil((left + width) * scale)),
    )
    marks[inner] = cv2.GC_PR_FGD
    if (marks == cv2.GC_PR_FGD).all():  # nothing to tell it from
        return np.zeros((height, width), np.bool_)
    cv2.setRNGSeed(SEED)
    models = np.zeros((2, 1, 65))
    cv2.grabCut(np.ascontiguousarray(small), marks, None, models[0], models[1], ROUNDS, cv2.GC_INIT_WITH_MASK)
    foreground = np.isin(marks, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.uint8)
    whole = cv2.resize(foreground, surroundings.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    inside: NDArray[np.bool_] = whole[top : top + height, left : left + width].astype(np.bool_)
    return inside
