"""The overlay puts colours and names where they belong."""

import numpy as np
import pytest

from ldls.palette import instance_colours
from ldls.viewing import overlay
from ldls.viewing.tags import place_tags

NAMES = ["car 0.98", "person 0.91"]
CATEGORIES = [3, 1]
MASKS = [(20, 10, np.ones((30, 60), bool)), (25, 200, np.ones((40, 15), bool))]


def _street_photo() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 255, (100, 300, 3), dtype=np.uint8)


@pytest.mark.parametrize(
    "scale",
    [pytest.param(None, id="enlarged to a legible width"), pytest.param(1, id="as it is")],
)
def test_a_labelled_point_has_its_instances_colour(scale: int | None) -> None:
    uv_px = np.array([[30.0, 45.0], [207.2, 60.4], [0.0, 0.0], [299.0, 99.0]])
    labels = np.array([1, 2, 1, 2], np.int32)
    picture = overlay(_street_photo(), MASKS, uv_px, labels, NAMES, CATEGORIES, scale=scale)
    enlarged = picture.width // 300
    assert picture.size == (300 * enlarged, 100 * enlarged)
    for (u, v), label in zip(uv_px, labels, strict=True):
        at = (int((u + 0.5) * enlarged), int((v + 0.5) * enlarged))
        assert picture.getpixel(at) == tuple(instance_colours(CATEGORIES)[label - 1])


def test_the_default_scale_makes_the_picture_wide_enough() -> None:
    empty = np.empty((0, 2)), np.empty(0, np.int32)
    assert overlay(_street_photo(), [], *empty, [], []).width == 1800
    assert overlay(np.zeros((10, 2000, 3), np.uint8), [], *empty, [], []).width == 2000


def test_background_points_leave_the_image_visible() -> None:
    uv_px = np.stack(np.meshgrid(np.arange(300.0), np.arange(100.0)), axis=-1).reshape(-1, 2)[::7]
    nothing = np.empty((0, 2)), np.empty(0, np.int32)
    without = np.asarray(overlay(_street_photo(), [], *nothing, [], []), np.float64)
    labels = np.zeros(len(uv_px), np.int32)
    with_points = np.asarray(overlay(_street_photo(), [], uv_px, labels, [], []), np.float64)
    assert 0 < np.abs(with_points - without).mean() < 10


def test_masks_and_names_must_agree_in_number() -> None:
    with pytest.raises(ValueError, match="zip"):
        overlay(_street_photo(), MASKS, np.empty((0, 2)), np.empty(0, np.int32), NAMES[:1], CATEGORIES)


@pytest.mark.parametrize(
    "boxes",
    [
        pytest.param([(50, 30, 90, 80)] * 6, id="all in one place"),
        pytest.param([(0, 0, 20, 90), (380, 0, 400, 90), (190, 0, 210, 9)], id="at the edges"),
    ],
)
def test_tags_stay_apart_and_inside(boxes: list[tuple[int, int, int, int]]) -> None:
    places = place_tags(boxes, [(80, 16)] * len(boxes), np.zeros((100, 200), bool), (400, 200))
    canvas = np.zeros((200, 400), int)
    for place in places:
        assert place is not None
        left, top, right, bottom = place
        assert left >= 0 and top >= 0 and right <= 400 and bottom <= 200
        canvas[top:bottom, left:right] += 1
    assert canvas.max() == 1


def test_a_tag_gives_way_to_what_is_drawn() -> None:
    covered = np.zeros((100, 200), bool)
    covered[40:60] = True
    (place,) = place_tags([(90, 60, 110, 90)], [(40, 10)], covered, (200, 100))
    assert place is not None
    left, top, right, bottom = place
    assert not covered[top:bottom, left:right].any()


def test_a_tag_without_room_is_left_out() -> None:
    assert place_tags([(0, 0, 9, 9)], [(80, 16)], np.zeros((20, 40), bool), (40, 20)) == [None]
