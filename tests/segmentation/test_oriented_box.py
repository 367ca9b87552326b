"""Boxes: their corners, and those around points, against the same in plain NumPy, heading by heading."""

import numpy as np
import pytest

import ldls
from ldls.segmentation import fit_upright_box


def plain_box(points):
    """Center, size and yaw of the box around (n, 3) points."""
    by_height = points[np.lexsort((points[:, 1], points[:, 0], points[:, 2]))]
    looked_at = by_height[:: -(-len(points) // 150), :2]
    stray, fits = int(0.04 * (len(looked_at) - 1)), []
    for heading in np.deg2rad(np.arange(90.0)):
        axes = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        to_sides, extents = [], []
        for places in axes @ looked_at.T:
            low, high = np.sort(places)[[stray, len(places) - 1 - stray]]
            to_sides.append(np.abs(places - (low if places.mean() < (low + high) / 2 else high)))
            extents.append(np.ptp(places))
        closeness = (1 / np.maximum(np.min(to_sides, axis=0), 0.1)).sum()
        fits.append((closeness, np.prod(extents), heading, axes))
    closest = max(closeness for closeness, *_ in fits)
    _, _, yaw, axes = min((fit for fit in fits if fit[0] >= 0.998 * closest), key=lambda fit: fit[1])
    places = np.hstack([points[:, :2] @ axes.T, points[:, 2:]])
    low, high = places.min(axis=0), places.max(axis=0)
    center, size = (low + high) / 2, high - low
    center[:2] = center[:2] @ axes
    if size[1] > size[0]:
        size[:2], yaw = size[1::-1], yaw - np.pi / 2 if yaw > 0 else np.pi / 2
    return center, size, yaw


def clouds():
    """Sides and rears of cars, lumps, lines and few points, turned and far away."""
    generator = np.random.default_rng(5)
    for number in range(120):
        n = int(generator.choice([1, 2, 3, 7, 40, 149, 150, 151, 700]))
        kind = number % 4
        local = generator.uniform([-2.2, -0.9], [2.2, 0.9], (n, 2))
        if kind < 2:
            on_side = generator.random(n) < 0.7
            local[on_side, 1], local[~on_side, 0] = -0.9, -2.2
            local += generator.normal(0, 0.03, local.shape)
        elif kind == 2:
            local[:, 1] = 0.4 * local[:, 0]
        yaw = generator.uniform(0, np.pi)
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        places = local @ turn + generator.uniform(-50, 50, 2)
        yield np.hstack([places, generator.uniform(-2, 1, (n, 1))])


def turned(local, yaw_deg, generator):
    """Places on the ground turned and moved to (10, -3), at random heights."""
    yaw = np.deg2rad(yaw_deg)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return np.hstack([local @ turn.T + [10, -3], generator.uniform(-1, 1, (len(local), 1))])


def test_boxes_are_those_of_plain_numpy():
    for points in clouds():
        box = fit_upright_box(points)
        for found, expected in zip((box.center, box.size, box.yaw), plain_box(points), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_box_holds_points_in_any_layout():
    points = next(clouds())
    turned_round = np.asfortranarray(points)
    assert fit_upright_box(turned_round).yaw == fit_upright_box(points).yaw


@pytest.mark.parametrize(
    ("points", "error"),
    [
        pytest.param(np.zeros((0, 3)), ldls.ShapeError, id="none"),
        pytest.param(np.zeros((4, 2)), ldls.ShapeError, id="two columns"),
        pytest.param(np.zeros(3), ldls.ShapeError, id="no rows"),
        pytest.param([[0, 0, 0], [1, np.nan, 0]], ldls.NonFiniteError, id="NaN"),
        pytest.param([[0, 0, 0], [1, 0, np.inf]], ldls.NonFiniteError, id="infinite"),
    ],
)
def test_what_has_no_box_is_refused(points, error):
    with pytest.raises(error, match="points: expected"):
        fit_upright_box(points)


def test_corners_go_round_the_bottom_and_then_the_top():
    box = ldls.OrientedBox(center=np.array([10.0, 5, 1]), size=np.array([4.0, 2, 3]), yaw=np.pi / 2)
    corners = box.corners()
    assert (corners.shape, corners.dtype) == ((8, 3), np.float64)
    # the length points along y: front is at y = 7, left at x = 9
    around = [[9, 7], [9, 3], [11, 3], [11, 7]]
    np.testing.assert_allclose(corners[:4], [[*place, -0.5] for place in around], atol=1e-12)
    np.testing.assert_allclose(corners[4:], [[*place, 2.5] for place in around], atol=1e-12)


@pytest.mark.parametrize("yaw_deg", [-60, 25])
def test_corners_enclose_the_points_of_the_box(yaw_deg):
    generator = np.random.default_rng(4)
    points = turned(generator.uniform([-2, -1], [2, 1], (100, 2)), yaw_deg, generator)
    corners = fit_upright_box(points).corners()
    for side in range(4):
        edge, there = corners[(side + 1) % 4] - corners[side], points - corners[side]
        # anticlockwise from above: the inside is to the left of every side
        assert (edge[0] * there[:, 1] - edge[1] * there[:, 0] >= -1e-9).all()
    assert (points[:, 2] >= corners[0, 2] - 1e-9).all() and (points[:, 2] <= corners[4, 2] + 1e-9).all()


@pytest.mark.parametrize("yaw_deg", [-89, -45, 0, 10, 33, 90])
def test_boxes_have_the_heading_of_two_sides_that_meet(yaw_deg):
    generator = np.random.default_rng(1)
    share = generator.uniform(-1, 1, (60, 1))
    corners = np.array([[2, 1], [2, -1], [-2, 1], [-2, -1]])
    local = np.vstack(
        [corners, np.hstack([2 * share, np.ones_like(share)]), np.hstack([np.full_like(share, 2), share])]
    )
    box = fit_upright_box(turned(local, yaw_deg, generator))
    np.testing.assert_allclose(box.size[:2], [4, 2], atol=1e-9)
    np.testing.assert_allclose(box.center[:2], [10, -3], atol=1e-9)
    assert np.rad2deg(box.yaw) == pytest.approx(yaw_deg)


@pytest.mark.parametrize("yaw_deg", [-45, 0, 33])
def test_boxes_of_points_all_over_are_right_to_some_degrees(yaw_deg):
    generator = np.random.default_rng(1)
    box = fit_upright_box(turned(generator.uniform([-2, -1], [2, 1], (400, 2)), yaw_deg, generator))
    assert abs(np.rad2deg(box.yaw) - yaw_deg) <= 8
    np.testing.assert_allclose(box.size[:2], [4, 2], atol=0.4)


@pytest.mark.parametrize("yaw_deg", [-70, 3, 48])
def test_a_stray_point_widens_a_box_and_does_not_turn_it(yaw_deg):
    generator = np.random.default_rng(2)
    side, rear = generator.uniform([-2, 1], [2, 1.05], (200, 2)), generator.uniform([-2, -1], [-1.95, 1], (100, 2))
    box = fit_upright_box(turned(np.vstack([side, rear, [[1.5, -2.5]]]), yaw_deg, generator))
    assert abs(np.rad2deg(box.yaw) - yaw_deg) <= 1
    np.testing.assert_allclose(box.size[:2], [4, 3.55], atol=0.15)


@pytest.mark.parametrize(
    ("places", "size"),
    [
        pytest.param([[3, 4]], [0, 0], id="one point"),
        pytest.param([[3, 4]] * 5, [0, 0], id="one place"),
        pytest.param([[0, 0], [3, 3]], [18**0.5, 0], id="two points"),
        pytest.param(np.linspace(0, 1, 40)[:, None] * [2, 2], [8**0.5, 0], id="a line"),
    ],
)
def test_boxes_of_few_points_have_no_width(places, size):
    ground = np.array(places, float)
    box = fit_upright_box(np.hstack([ground, np.zeros((len(ground), 1))]))
    np.testing.assert_allclose(box.size, [*size, 0], atol=1e-9)
