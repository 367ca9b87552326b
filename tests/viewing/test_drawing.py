"""Marks on pictures, against a rendering pixel by pixel."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from ldls.viewing.drawing import Canvas, disc, font_for

WIDTH, HEIGHT = 24, 16


def stamped_slowly(pixels, at_px, colours, mark):
    """A pixel of the mark after the other, the faintest first; each reads what all others of before left."""
    pixels, reach = pixels.copy(), mark.shape[0] // 2
    for at in np.argsort(mark, axis=None):
        dy, dx = divmod(int(at), mark.shape[1])
        before = pixels.copy()
        for (x, y), colour in zip(np.add(at_px, (dx - reach, dy - reach)), colours, strict=True):
            if 0 <= x < WIDTH and 0 <= y < HEIGHT and mark[dy, dx] > 0:
                pixels[y, x] = np.round((1 - mark[dy, dx]) * before[y, x] + mark[dy, dx] * np.array(colour, float))
    return pixels


@pytest.mark.parametrize("mark", [disc(0.45, 0.5), disc(1.1), disc(2.6, 0.55)], ids=["a dot", "a disc", "a halo"])
@pytest.mark.parametrize("in_one_colour", [True, False])
def test_marks_are_those_drawn_pixel_by_pixel_also_at_and_beyond_the_edge(mark, in_one_colour):
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    at_px = rng.integers(-8, [WIDTH + 8, HEIGHT + 8], (150, 2))
    colours = (9, 200, 77) if in_one_colour else rng.integers(0, 256, (150, 3), np.uint8)
    canvas = Canvas(Image.fromarray(pixels), radius_px=2.6)
    canvas.stamp(at_px, colours, mark)
    each = [colours] * 150 if in_one_colour else colours
    expected = stamped_slowly(pixels, at_px, each, mark)
    assert np.array_equal(np.asarray(canvas.picture().convert("RGB")), expected)


def test_what_is_drawn_on_a_copy_is_not_on_the_canvas():
    canvas = Canvas(Image.new("RGB", (WIDTH, HEIGHT)), radius_px=1)
    copied = canvas.copy()
    copied.stamp(np.array([[3, 3]]), (255, 255, 255), disc(1.0))
    assert np.asarray(copied.picture().convert("RGB")).any() and not np.asarray(canvas.picture().convert("RGB")).any()


@pytest.mark.parametrize("own", [["car 1", "person 2"], ["a very long na\u2026 3"], [], ["car", "\uffff"]])
def test_letters_that_every_machine_has_look_the_same_on_all(own):
    assert isinstance(font_for(own, 12).path, BytesIO), "a font in memory is Pillow's"


def test_other_letters_are_drawn_by_a_font_that_has_them():
    font = font_for(["Fu\u00dfg\u00e4nger 4", "car 1"], 12)
    if isinstance(font.path, BytesIO):
        pytest.skip("the system has no font of those that are looked for")
    missing = bytes(font.getmask("\uffff"))
    assert missing not in [bytes(font.getmask(letter)) for letter in "\u00df\u00e4"]
