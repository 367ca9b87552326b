"""Colours that tell instances apart."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

DISTINCT = 256  # colours, before they start again
FIRST = (255, 136, 0)
# Linear RGB to OKLab (https://bottosson.github.io/posts/oklab/), by way of its cone responses,
# and to what an eye without green cones makes of it (Machado, Oliveira and Fernandes 2009).
CONES = [[0.41222, 0.53633, 0.05145], [0.21190, 0.68070, 0.10740], [0.08830, 0.28172, 0.62998]]
OKLAB = [[0.21045, 0.79362, -0.00407], [1.97800, -2.42859, 0.45059], [0.02590, 0.78277, -0.80868]]
NO_GREEN = [[0.36732, 0.86065, -0.22797], [0.28009, 0.6725, 0.04741], [-0.01182, 0.04294, 0.96888]]


def palette(n: int) -> NDArray[np.uint8]:
    """Return `n` colours (n, 3), RGB, none near grey; the m-th is the same for every `n`."""
    order = _order_of_colours()
    return np.asarray(order[np.arange(n) % len(order)])


@cache
def _order_of_colours() -> NDArray[np.uint8]:
    """Return vivid colours, each the farthest from those before it, also for colour-blind eyes."""
    level = np.arange(0, 256, 17.0)
    rgb = np.stack(np.meshgrid(level, level, level), axis=-1).reshape(-1, 3)
    lightness, *chroma = _oklab(rgb, np.eye(3)).T
    rgb = rgb[(np.hypot(*chroma) > 0.14) & (lightness > 0.58) & (lightness < 0.92)]
    normal, colour_blind = _oklab(rgb, np.eye(3)), _oklab(rgb, np.array(NO_GREEN))
    chosen = [int(np.abs(rgb - FIRST).sum(axis=1).argmin())]
    nearest = np.full(len(rgb), np.inf)
    while len(chosen) < DISTINCT:
        gap, gap_blind = (np.linalg.norm(lab - lab[chosen[-1]], axis=1) for lab in (normal, colour_blind))
        nearest = np.minimum(nearest, gap + 0.5 * gap_blind)
        chosen.append(int(nearest.argmax()))
    return np.asarray(rgb[chosen].astype(np.uint8))


def _oklab(rgb: NDArray[np.float64], eye: NDArray[np.float64]) -> NDArray[np.float64]:
    linear = ((rgb / 255 + 0.055) / 1.055) ** 2.4
    cones = np.cbrt((linear @ eye.T).clip(0) @ np.array(CONES).T)
    return np.asarray(cones @ np.array(OKLAB).T)


BACKGROUND = (128, 128, 128)
"""Colour of points without an object."""
