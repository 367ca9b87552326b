"""Name tags on a picture: near the things that they name, clear of one another and of the drawing."""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from ldls.cloud import Ints
from ldls.palette import Colour
from ldls.viewing.drawing import font_for, one_line

AVERSION = 4.0
"""Heights of a tag that it goes aside rather than lie where it had better not be."""
LONGEST = 20
"""Characters of a name, without its number, of which a tag shows no more."""
Box = tuple[int, int, int, int]  # left, top, right, bottom, in pixels of the picture


class Tag(NamedTuple):
    """A text for the thing in `box`."""

    text: str
    colour: Colour
    box: Box


def draw_tags(
    picture: Image.Image,
    tags: Sequence[Tag],
    covered: NDArray[np.bool_],
    pen_px: float,
    *,
    aversion: float = AVERSION,
    taken: Sequence[Box] = (),
) -> None:
    """Draw tags onto the picture, long names shortened; one for which no room is left is not drawn.

    `covered` (H, W), of the picture's shape at any size, is where tags had better not be; `aversion` is the
    number of its heights that a tag goes aside rather than lie there. Tags stay clear of the boxes `taken`.
    """
    draw = ImageDraw.Draw(picture)
    tags = [tag._replace(text=shortened(one_line(tag.text))) for tag in tags]
    font = font_for((tag.text for tag in tags), 12 * pen_px)
    places = place_tags(
        [tag.box for tag in tags],
        [(ceil(draw.textlength(tag.text, font) + 8 * pen_px), ceil(17 * pen_px)) for tag in tags],
        covered,
        picture.size,
        aversion,
        taken,
    )
    shown = [(tag, place) for tag, place in zip(tags, places, strict=True) if place]
    for tag, place in shown:
        top_middle = ((tag.box[0] + tag.box[2]) / 2, tag.box[1] + 2 * pen_px)
        draw.line([_middle(place), top_middle], tag.colour, ceil(pen_px))
    for tag, place in shown:
        draw.rounded_rectangle(place, 3 * pen_px, tag.colour)
        draw.text(_middle(place), tag.text, _ink(tag.colour), font, anchor="mm")


def shortened(text: str) -> str:
    """`text` with no more than the beginning of a long name; the number behind it stays."""
    name, _, number = text.rpartition(" ")
    if not number.isdecimal():
        name, number = text, ""
    if len(name) <= LONGEST:
        return text
    return f"{name[: LONGEST - 1].rstrip()}\u2026 {number}".rstrip()


def place_tags(
    boxes: Sequence[Box],
    sizes: Sequence[tuple[int, int]],
    covered: NDArray[np.bool_],
    picture: tuple[int, int],
    aversion: float = AVERSION,
    taken: Sequence[Box] = (),
) -> list[Box | None]:
    """Place of each tag, inside the picture and apart; None where no room is left."""
    cover = np.zeros((covered.shape[0] + 1, covered.shape[1] + 1), np.int32)
    covered.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, out=cover[1:, 1:])
    places: list[Box | None] = [None] * len(boxes)
    for index in sorted(range(len(boxes)), key=lambda i: -boxes[i][3]):  # the nearest chooses first
        own = [place for place in places if place]
        places[index] = _best_place(boxes[index], sizes[index], picture, [*taken, *own], cover, aversion)
    return places


def _best_place(
    box: Box,
    size: tuple[int, int],
    picture: tuple[int, int],
    taken: Sequence[Box],
    cover: NDArray[np.int32],
    aversion: float,
) -> Box | None:
    """Return the free place nearest to the top of `box`, rather farther off than over objects."""
    width, height = size
    step = max(height // 4, 1)
    # places in rows and columns
    left, top = np.arange(0, picture[0] - width, step), np.arange(0, picture[1] - height, step)[:, None]
    right, bottom = left + width, top + height
    aside_px = np.abs((left + right - box[0] - box[2]) / 2)
    off_px = np.abs(bottom + height // 4 - box[1])
    cost = np.hypot(aside_px, off_px) + aversion * height * _covered_share(cover, picture, left, top, right, bottom)
    for low_x, low_y, high_x, high_y in taken:
        cost[((bottom >= low_y) & (top <= high_y)) & ((right >= low_x) & (left <= high_x))] = np.inf
    if not np.isfinite(cost).any():
        return None
    row, column = divmod(int(cost.argmin()), len(left))
    return int(left[column]), int(top[row, 0]), int(right[column]), int(bottom[row, 0])


def _covered_share(
    cover: NDArray[np.int32], picture: tuple[int, int], left: Ints, top: Ints, right: Ints, bottom: Ints
) -> NDArray[np.float64]:
    """Share of each place that is covered, by sums of the cover over all that lies above and left of a pixel of it."""
    across, down = (cover.shape[1] - 1) / picture[0], (cover.shape[0] - 1) / picture[1]
    left, right = (left * across).astype(int), (right * across).astype(int)
    top, bottom = (top[:, 0] * down).astype(int), (bottom[:, 0] * down).astype(int)
    rows = cover[bottom] - cover[top]
    return np.asarray((rows[:, right] - rows[:, left]) / np.maximum((right - left) * (bottom - top)[:, None], 1))


def _middle(box: Box) -> tuple[float, float]:
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def _ink(paper: Colour) -> Colour:
    red, green, blue = paper
    return (0, 0, 0) if 0.3 * red + 0.59 * green + 0.11 * blue > 115 else (255, 255, 255)
