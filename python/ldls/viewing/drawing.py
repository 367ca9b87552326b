"""Discs set on a picture at many places at once, and several pictures in one."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ldls.palette import Colour

Canvas = NDArray[np.uint8]
"""(H, W, 3) red, green and blue of a picture that is drawn on."""
Opacity = NDArray[np.float64]
"""(2 r + 1, 2 r + 1) share of the picture that a mark covers, 0 to 1."""
PAPER: Colour = (24, 24, 28)
INK: Colour = (235, 235, 235)
MARK: Colour = (255, 255, 255)
"""Colour of the rim of marked points."""
GAP_PX = 6
FONT_PX = 17
CAPTION_PX = 30


def disc(radius_px: float, opacity: float = 1.0) -> Opacity:
    """A smooth disc in the middle of an odd square."""
    reach = ceil(radius_px + 0.5)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(opacity * (radius_px + 0.5 - np.hypot(x, y)).clip(0, 1))


def stamp(canvas: Canvas, at_px: NDArray[np.int64], colours: NDArray[np.uint8] | Colour, mark: Opacity) -> None:
    """Set `mark` on the canvas around every one of `at_px` (n, 2), x and y, each in its colour (n, 3) or all in one.

    Later ones lie above earlier ones; parts beyond the edge are cut off.
    """
    reach = mark.shape[0] // 2
    height, width = canvas.shape[:2]
    seen = ((at_px >= -reach) & (at_px < (width + reach, height + reach))).all(axis=1)
    colours, at_px = np.asarray(colours, np.uint8), at_px[seen]
    if colours.ndim == 1:
        # in one colour it is all the same how many lie at a place
        across = width + 2 * reach
        places = np.unique((at_px + reach) @ (1, across))
        at_px = np.stack([places % across, places // across], axis=1) - reach
    own = colours[seen] if colours.ndim == 2 else np.broadcast_to(colours, (len(at_px), 3))
    flat = canvas.reshape(-1, 3)
    # the faintest pixels of the mark first, so that no rim covers the middle of a neighbour
    for at in np.argsort(mark, axis=None):
        dy, dx = divmod(int(at), mark.shape[1])
        opacity = mark[dy, dx]
        if opacity == 0:
            continue
        x, y = at_px[:, 0] + dx - reach, at_px[:, 1] + dy - reach
        inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
        places, above = (y * width + x)[inside], own[inside]
        flat[places] = above if opacity == 1 else np.round((1 - opacity) * flat[places] + opacity * above)


def grid(
    pictures: Sequence[Image.Image], captions: Sequence[str] = (), *, columns: int, gap_px: int = GAP_PX
) -> Image.Image:
    """The pictures row by row, each below its caption if any."""
    sizes = [picture.size for picture in pictures]
    corners, size = places_in_grid(sizes, captions=bool(captions), columns=columns, gap_px=gap_px)
    whole = Image.new("RGB", size, PAPER)
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(size=FONT_PX)
    for i, (left, top) in enumerate(corners):
        if captions:
            draw.text((left + FONT_PX // 2, top - CAPTION_PX // 2), captions[i], INK, font, anchor="lm")
        whole.paste(pictures[i], (left, top))
    return whole


def places_in_grid(
    sizes: Sequence[tuple[int, int]], *, captions: bool, columns: int, gap_px: int = GAP_PX
) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Left and top of each picture of `grid`, by their widths and heights, and width and height of the whole."""
    caption_px = CAPTION_PX if captions else 0
    rows = [range(start, min(start + columns, len(sizes))) for start in range(0, len(sizes), columns)]
    widths = [max(sizes[i][0] for i in range(column, len(sizes), columns)) for column in range(columns)]
    heights = [max(sizes[i][1] for i in row) for row in rows]
    lefts = [sum(widths[:column]) + gap_px * column for column in range(columns)]
    tops = [sum(heights[:row]) + caption_px * (row + 1) for row in range(len(rows))]
    corners = [(lefts[i % columns], tops[i // columns]) for i in range(len(sizes))]
    return corners, (sum(widths) + gap_px * (columns - 1), sum(heights) + caption_px * len(rows))


def half(width_px: int) -> int:
    """Width of each of two pictures side by side."""
    return (width_px - GAP_PX) // 2
