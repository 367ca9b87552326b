"""Several pictures in one, each under its caption."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from ldls.palette import Colour

PAPER: Colour = (24, 24, 28)
INK: Colour = (235, 235, 235)
GAP_PX = 6
FONT_PX = 17
CAPTION_PX = 30


def grid(pictures: Sequence[Image.Image], captions: Sequence[str] = (), *, columns: int) -> Image.Image:
    """The pictures row by row, each below its caption if any."""
    caption_px = CAPTION_PX if captions else 0
    rows = [range(start, min(start + columns, len(pictures))) for start in range(0, len(pictures), columns)]
    widths = [max(pictures[i].width for i in range(column, len(pictures), columns)) for column in range(columns)]
    heights = [max(pictures[i].height for i in row) for row in rows]
    whole = Image.new(
        "RGB",
        (sum(widths) + GAP_PX * (columns - 1), sum(heights) + caption_px * len(rows)),
        PAPER,
    )
    top = 0
    for row, height in zip(rows, heights, strict=True):
        left = 0
        for i, width in zip(row, widths, strict=False):
            if captions:
                _write(whole, (left, top), captions[i])
            whole.paste(pictures[i], (left, top + caption_px))
            left += width + GAP_PX
        top += caption_px + height
    return whole


def half(width_px: int) -> int:
    """Width of each of two pictures side by side."""
    return (width_px - GAP_PX) // 2


def _write(picture: Image.Image, corner: tuple[int, int], caption: str) -> None:
    at = (corner[0] + FONT_PX // 2, corner[1] + CAPTION_PX // 2)
    ImageDraw.Draw(picture).text(at, caption, INK, ImageFont.load_default(size=FONT_PX), anchor="lm")
