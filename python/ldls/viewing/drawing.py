"""Discs set on a picture at many places at once, and several pictures in one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from copy import deepcopy
from math import ceil

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ldls.palette import Colour

Opacity = NDArray[np.float64]
"""(2 r + 1, 2 r + 1) share of the picture that a mark covers, 0 to 1."""
PAPER: Colour = (24, 24, 28)
INK: Colour = (235, 235, 235)
MARK: Colour = (255, 255, 255)
"""Colour of the rim of marked points."""
GAP_PX = 6
FONT_PX = 17
FONTS = (
    "DejaVuSans.ttf",
    "NotoSans-Regular.ttf",
    "arial.ttf",
    "Arial.ttf",
    "NotoSansCJK-Regular.ttc",
    "msyh.ttc",
    "Arial Unicode.ttf",
)
"""Files of fonts of Linux, Windows and macOS, as they name them."""
CAPTION_PX = 30


def disc(radius_px: float, opacity: float = 1.0) -> Opacity:
    """A smooth disc in the middle of an odd square."""
    reach = _reach(radius_px)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return np.asarray(opacity * (radius_px + 0.5 - np.hypot(x, y)).clip(0, 1))


class Canvas:
    """A picture that marks are set on."""

    def __init__(self, picture: Image.Image, *, radius_px: float) -> None:
        """A copy of the picture, for marks of up to this radius."""
        self._size = np.array(picture.size)
        # marks at places beyond the edge reach into the margin
        self._margin = 2 * _reach(radius_px)
        width, height = self._size + 2 * self._margin
        # a number a pixel, whose last byte is not used
        self._pixels = np.zeros((height, width), np.uint32)
        self._inside()[:] = np.asarray(picture.convert("RGBX")).view(np.uint32)[..., 0]

    def copy(self) -> Canvas:
        """A canvas of its own with the same picture."""
        return deepcopy(self)

    def picture(self) -> Image.Image:
        """A copy of the picture as it is now, of mode RGBX."""
        width, height = self._size.tolist()
        return Image.frombuffer("RGBX", (width, height), self._inside().tobytes(), "raw", "RGBX", 0, 1)

    def stamp(self, at_px: NDArray[np.int64], colours: NDArray[np.uint8] | Colour, mark: Opacity) -> None:
        """Set `mark` around every one of `at_px` (n, 2), x and y, each in its colour (n, 3) or all in one.

        Later ones lie above earlier ones; parts beyond the edge are cut off.
        """
        reach = mark.shape[0] // 2
        seen = ((at_px >= -reach) & (at_px < self._size + reach)).all(axis=1)
        across = self._pixels.shape[1]
        places = (at_px[seen] + self._margin) @ (1, across)
        colours = np.asarray(colours, np.uint8)
        if colours.ndim == 1:
            # in one colour it is all the same how many lie at a place
            taken = np.zeros(self._pixels.size, bool)
            taken[places] = True
            places, own = np.flatnonzero(taken), colours[None]
        else:
            own = colours[seen]
        own = np.pad(own, ((0, 0), (0, 1)))
        flat = self._pixels.reshape(-1)
        # the faintest pixels of the mark first, so that no rim covers the middle of a neighbour
        for at in np.argsort(mark, axis=None):
            dy, dx = divmod(int(at), mark.shape[1])
            opacity = mark[dy, dx]
            if opacity == 0:
                continue
            here = places + ((dy - reach) * across + dx - reach)
            above = own
            if opacity < 1:
                below = flat[here].view(np.uint8).reshape(-1, 4)
                above = np.round((1 - opacity) * below + opacity * own).astype(np.uint8)
            flat[here] = above.view(np.uint32)[:, 0]

    def _inside(self) -> NDArray[np.uint32]:
        width, height = self._size
        return self._pixels[self._margin : self._margin + height, self._margin : self._margin + width]


def font_for(texts: Iterable[str], size_px: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font, the same everywhere; where it lacks a letter one of the system's that has all, if any."""
    own = ImageFont.load_default(size=size_px)
    letters = sorted({letter for text in texts for letter in text if not letter.isascii() and letter.isprintable()})
    if not letters or _has(own, letters):
        return own
    for name in FONTS:
        with suppress(OSError):
            font = ImageFont.truetype(name, size_px)
            if _has(font, letters):
                return font
    return own


def _has(font: ImageFont.FreeTypeFont | ImageFont.ImageFont, letters: Sequence[str]) -> bool:
    """True if none of `letters` is drawn as what no font has."""
    missing = bytes(font.getmask("\uffff"))
    return all(bytes(font.getmask(letter)) != missing for letter in letters)


def grid(
    pictures: Sequence[Image.Image], captions: Sequence[str] = (), *, columns: int, gap_px: int = GAP_PX
) -> Image.Image:
    """The pictures row by row, each below its caption if any."""
    sizes = [picture.size for picture in pictures]
    corners, size = places_in_grid(sizes, captions=bool(captions), columns=columns, gap_px=gap_px)
    whole = Image.new("RGB", size, PAPER)
    captions = [one_line(caption) for caption in captions]
    draw, font = ImageDraw.Draw(whole), font_for(captions, FONT_PX)
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


def one_line(text: str) -> str:
    """`text` on one line, as texts that are drawn at a place are; names may have line breaks."""
    return " ".join(text.split())


def _reach(radius_px: float) -> int:
    return ceil(radius_px + 0.5)
