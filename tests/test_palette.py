"""Hues say categories and shades instances, to colour-blind eyes too."""

from itertools import combinations

import numpy as np
import pytest

from ldls.categories import COCO_NAMES
from ldls.palette import BACKGROUND, category_colour, instance_colours

# Linear RGB to cone responses and to OKLab, as published by Ottosson, and what an eye without one kind of cones makes
# of linear RGB, as published by Machado, Oliveira and Fernandes 2009.
CONES = [[0.41222, 0.53633, 0.05145], [0.21190, 0.68070, 0.10740], [0.08830, 0.28172, 0.62998]]
OKLAB = [[0.21045, 0.79362, -0.00407], [1.97800, -2.42859, 0.45059], [0.02590, 0.78277, -0.80868]]
EYES = {
    "all cones": np.eye(3),
    "no long cones": [[0.15229, 1.05258, -0.20487], [0.11450, 0.78628, 0.09922], [-0.00388, -0.04812, 1.05200]],
    "no medium cones": [[0.36732, 0.86065, -0.22797], [0.28009, 0.6725, 0.04741], [-0.01182, 0.04294, 0.96888]],
    "no short cones": [[1.25553, -0.07675, -0.17878], [-0.07841, 0.93081, 0.14760], [0.00473, 0.69137, 0.30390]],
}
TRAFFIC = [1, 2, 3, 4, 6, 8]


def seen(colours, eye="all cones"):
    """OKLab of colours, to an eye; 0.02 is a difference that one just sees."""
    linear = ((np.atleast_2d(colours) / 255 + 0.055) / 1.055) ** 2.4
    return np.cbrt((linear @ np.array(EYES[eye]).T).clip(0) @ np.array(CONES).T) @ np.array(OKLAB).T


def hue(colours):
    _, green_red, blue_yellow = seen(colours).T
    return np.degrees(np.arctan2(blue_yellow, green_red))


@pytest.mark.parametrize("eye", EYES)
def test_categories_of_traffic_are_apart_from_one_another_and_from_grey(eye: str) -> None:
    colours = seen([BACKGROUND, *map(category_colour, TRAFFIC)], eye)
    assert min(np.linalg.norm(one - other) for one, other in combinations(colours, 2)) > 0.08


def test_a_category_has_one_hue_whatever_else_is_there() -> None:
    alone = instance_colours([3])
    among = instance_colours([1, 3, 18, 3, 62])
    np.testing.assert_array_equal(among[1], alone[0])
    assert tuple(alone[0]) == category_colour(3)


def test_hues_whose_shades_meet_are_those_of_the_documentation() -> None:
    shades = {category: seen(instance_colours([category] * 7)) for category in (*TRAFFIC, *range(100, 110))}
    near = {
        (one, other)
        for one, other in combinations(shades, 2)
        if np.linalg.norm(shades[one][:, None] - shades[other], axis=-1).min() < 0.05
    }
    # person and 9, motorcycle and 7, truck and 6
    assert near == {(103, 105), (1, 109), (4, 107), (8, 106)}


@pytest.mark.parametrize("category", [*TRAFFIC, *range(100, 110)])
def test_instances_differ_in_shade_and_not_in_hue(category: int) -> None:
    shades = instance_colours([category] * 14)
    turned = (hue(shades) - hue(category_colour(category)) + 180) % 360 - 180
    assert np.abs(turned).max() < 3
    assert len({tuple(shade) for shade in shades}) == 14
    lab = seen(shades)
    assert min(np.linalg.norm(one - other) for one, other in combinations(lab[:7], 2)) > 0.02
    assert np.hypot(lab[:, 1], lab[:, 2]).min() > 0.04, "a shade that looks grey"


def test_no_colour_of_a_known_category_is_dark_or_grey() -> None:
    lab = seen([category_colour(category) for category in COCO_NAMES])
    assert lab[:, 0].min() > 0.55
    assert np.hypot(lab[:, 1], lab[:, 2]).min() > 0.1


def test_tracks_keep_their_colour_whatever_else_is_there() -> None:
    first, second = instance_colours([3, 1, 3], [5, 6, 7]), instance_colours([3, 3, 1], [7, 5, 6])
    np.testing.assert_array_equal(first, second[[1, 2, 0]])
    assert not np.array_equal(first[0], first[2])
    np.testing.assert_array_equal(instance_colours([3, 3], [1, 2]), instance_colours([3, 3], [0, 0]))


def test_no_instances_have_no_colours() -> None:
    assert instance_colours([]).shape == (0, 3)
    assert instance_colours(np.array([3], np.int32)).dtype == np.uint8
