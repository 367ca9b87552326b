"""The ground against a slow rendering of its description, and against grounds that are known."""

import itertools
import math

import numpy as np
import pytest

import ldls
from conftest import pinhole
from ldls.simulation import sample_frame

ROUNDS = [(1, 1.0), (2, 0.5), (3, 0.5), (4, 0.4), (5, 0.3), (5, 0.2), (5, 0.1)]
RIDGE = [0.0, 1e-5, 1e-4, 5e-4, 1e-3, 2e-3]


def expected_heights(points, center, local):
    """Heights (n,) above the ground by plain loops and NumPy's solver."""
    places = np.asarray(points, np.float64)[:, :3] - center
    cells = lowest_places(places)
    surface = fitted(cells) if len(cells) >= 12 else None
    camera_below = surface is not None and above(surface, np.zeros((1, 3)))[0] <= 0
    if surface is None or camera_below or (np.abs(above(surface, cells)) < 0.15).sum() < 12:
        return np.full(len(places), np.nan)
    heights = above(surface, places)
    return heights - local_offsets(places, heights) if local else heights


def lowest_places(places):
    """The lowest place of each polar cell: nine rings as often as the distance doubles, thirty sectors a quadrant."""
    lowest = {}
    for place in places:
        x, y, z = place
        ratio = math.hypot(x, y) / 0.5
        if ratio <= 1:
            continue
        doublings = math.floor(math.log2(ratio))
        ring = min(math.floor(9 * (doublings + ratio / 2**doublings - 1)), 79)
        across = y / (abs(x) + abs(y))
        turn = 1 + across if x >= 0 else 3 - across
        cell = ring, min(math.floor(30 * turn), 119)
        if cell not in lowest or z < lowest[cell][2]:
            lowest[cell] = place
    return np.array([*lowest.values()]).reshape(-1, 3)


def powers(places, degree):
    """(n, T) products x^a y^b with a + b of a degree at most, in units of 30 m."""
    x, y = places[:, 0] / 30, places[:, 1] / 30
    return np.column_stack([x ** (d - b) * y**b for d in range(degree + 1) for b in range(d + 1)])


def above(surface, places):
    degree, coefficients = surface
    return places[:, 2] - powers(places, degree) @ coefficients


def least_squares(cells, degree, weights):
    terms = powers(cells, degree)
    ridge = [RIDGE[d] * len(cells) for d in range(degree + 1) for _ in range(d + 1)]
    normal = terms.T @ (terms * weights[:, None]) + np.diag(ridge)
    return degree, np.linalg.solve(normal, terms.T @ (weights * cells[:, 2]))


def fitted(cells):
    """A surface that what lies above it pulls little: degree and coefficients; none where the equations have none."""
    try:
        surface = least_squares(cells, 1, np.ones(len(cells)))
        for _ in range(12):
            surface = least_squares(cells, 1, np.where(above(surface, cells) > 0, 0.05, 0.95))
        for degree, scale in ROUNDS:
            residuals = above(surface, cells)
            relative = np.where(residuals > 0, 2.5, 1.0) * residuals / scale
            surface = least_squares(cells, degree, (1 + relative**2) ** -2)
    except np.linalg.LinAlgError:
        return None
    return surface


def local_offsets(places, heights):
    """Height (n,) of the level that each place stands on: the highest not above it, else the lowest, of the levels in
    its cell of 1 m and the eight around it."""
    cells = np.floor(places[:, :2]).astype(int)
    steps = np.floor((heights + 0.22) / 0.02)
    near = (steps >= 0) & (steps < 22)
    levels = {}
    for cell in {tuple(cell) for cell in cells.tolist()}:
        around = near & (np.abs(cells - cell).max(axis=1) <= 1)
        counts = np.bincount(steps[around].astype(int), minlength=22)
        layers = np.lib.stride_tricks.sliding_window_view(counts, 3)
        full = layers.sum(axis=1)
        below, above = np.append(-1, full[:-1]), np.append(full[1:], 0)
        found = (full > below) & (full >= above) & (full >= 20) & (full >= 0.3 * counts.sum())
        middles = (np.arange(20)[:, None] + np.arange(3) + 0.5) * 0.02 - 0.22
        levels[cell] = ((layers * middles).sum(axis=1)[found] / full[found])[:3]
    offsets = []
    for cell, height in zip(cells.tolist(), heights, strict=True):
        own = levels[tuple(cell)]
        not_above = own[own <= height + 0.03]
        offsets.append(not_above[-1] if len(not_above) else own[0] if len(own) else 0.0)
    return np.array(offsets)


def sloping_road(seed, slope=(0.05, -0.03)):
    """Points on a slope and in boxes upon it, and how high each lies above the slope."""
    generator = np.random.default_rng(seed)
    road = generator.uniform([2, -12], [45, 12], (9000, 2))
    parts, clear = [], np.ones(len(road), bool)
    for corner in generator.uniform([6, -8], [30, 8], (8, 2)):
        far = corner + np.array([0.5, 2.0])
        parts.append(generator.uniform([*corner, 0.3], [*far, 1.8], (250, 3)))
        clear &= ((road < corner) | (road > far)).any(axis=1)
    parts.append(np.column_stack([road[clear], np.zeros(clear.sum())]))
    x, y, up = np.concatenate(parts).T
    return np.column_stack([x, y, slope[0] * x + slope[1] * y + up - 1.7]), up


def random_cloud(seed, points=3000):
    return np.random.default_rng(seed).uniform([-40, -40, -2], [40, 40, 3], (points, 3))


def tufts(seed):
    """Points spread over 22 cm of height, among which a layer at 10 cm grows from a tenth of all to most with x."""
    generator = np.random.default_rng(seed)
    x, y, spread, share = generator.uniform([2, -6, 0, 0], [30, 6, 0.22, 1], (9000, 4)).T
    return np.column_stack([x, y, np.where(share < x / 32, 0.1, spread) - 1.7])


AHEAD = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
TURNED = AHEAD + np.array([[0, 0, 0, 0.3], [0, 0, 0, -0.2], [0, 0, 0, -0.5], [0, 0, 0, 0]])
CAMERA = pinhole(T_camera_lidar=AHEAD)


@pytest.mark.parametrize("local", [False, True], ids=["smooth", "local"])
@pytest.mark.parametrize(
    "points",
    [
        pytest.param(sloping_road(1)[0], id="boxes on a slope"),
        pytest.param(sloping_road(2, (-0.1, 0.08))[0], id="boxes on a steep slope"),
        pytest.param(tufts(3), id="a layer among tufts"),
        pytest.param(tufts(4)[::5], id="a layer of few points"),
        pytest.param(random_cloud(3), id="no ground in it"),
        pytest.param(random_cloud(4, 60), id="few points"),
        pytest.param(random_cloud(5) * [1, 1, 0.02], id="a thick plain"),
        pytest.param(random_cloud(6) * 1e-2, id="nothing but the vehicle"),
    ],
)
def test_heights_are_those_of_the_description(points, local):
    camera = pinhole(T_camera_lidar=TURNED)
    center = np.linalg.inv(TURNED)[:3, 3]
    heights = ldls.stages.ground(points, camera, local_ground=local)
    np.testing.assert_allclose(heights, expected_heights(points, center, local), rtol=0, atol=1e-6)


def test_a_cloud_in_the_frame_of_its_camera_has_its_ground_below_minus_y():
    points, _ = sloping_road(7)
    turned = points @ AHEAD[:3, :3].T
    np.testing.assert_allclose(ldls.stages.ground(turned, pinhole()), ldls.stages.ground(points, CAMERA), atol=1e-9)


@pytest.mark.parametrize("local", [False, True], ids=["smooth", "local"])
def test_heights_of_a_simulated_street(local):
    frame = sample_frame()
    camera = frame.images[0].camera
    rows, _ = ldls.stages.project(
        frame.points, camera, image_size=camera.image_size or frame.images[0].masks.image_size
    )
    points = frame.points[rows]
    center = np.linalg.inv(camera.T_camera_lidar)[:3, 3]
    heights = ldls.stages.ground(points, camera, local_ground=local)
    np.testing.assert_allclose(heights, expected_heights(points, center, local), rtol=0, atol=1e-6)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.05, -0.03), (-0.12, 0.1)], ids=["flat", "gentle", "steep"])
@pytest.mark.parametrize("local", [False, True], ids=["smooth", "local"])
def test_boxes_stand_on_a_tilted_plane(slope, local):
    points, up = sloping_road(7, slope)
    np.testing.assert_allclose(ldls.stages.ground(points, CAMERA, local_ground=local), up, atol=0.02)


def test_the_local_ground_is_that_of_a_pavement():
    generator = np.random.default_rng(8)
    xy = generator.uniform([2, -8], [30, 8], (20_000, 2))
    up = np.where(xy[:, 1] > 3, 0.12, 0.0)
    points = np.column_stack([xy, 0.03 * xy[:, 0] + up - 1.7])
    inside = np.abs(xy[:, 1] - 3) > 2
    smooth, local = (ldls.stages.ground(points, CAMERA, local_ground=local)[inside] for local in (False, True))
    assert np.abs(local).max() < 0.03
    assert np.abs(local).mean() < 0.005
    assert np.abs(smooth).mean() > 0.01


def test_the_edge_of_a_pavement_is_ground_and_what_stands_beside_it_is_not():
    generator = np.random.default_rng(9)
    xy = generator.uniform([2, -8], [30, 8], (20_000, 2))
    kerb, wheel = np.array([14.0, 3.0]), generator.uniform([13.9, 2.5, 0.05], [14.1, 2.9, 0.5], (60, 3))
    up = np.concatenate([np.where(xy[:, 1] > kerb[1], 0.12, 0.0), wheel[:, 2]])
    xy = np.concatenate([xy, wheel[:, :2]])
    points = np.column_stack([xy, 0.03 * xy[:, 0] + up - 1.7])
    heights = ldls.stages.ground(points, CAMERA)
    near = np.abs(xy - kerb).max(axis=1) < 0.8
    assert np.abs(heights[near][up[near] == 0.12]).max() < 0.03
    assert np.abs(heights[near][up[near] == 0]).max() < 0.03
    stands = (up > 0.2) & (up < 0.5)
    np.testing.assert_allclose(heights[stands], up[stands] - 0.12, atol=0.03)


def test_a_slope_that_bends_is_followed():
    xy = np.random.default_rng(9).uniform([2, -15], [60, 15], (15_000, 2))
    points = np.column_stack([xy, 0.08 * xy[:, 0] + 0.5 * np.sin(xy[:, 0] / 14) - 1.7])
    assert np.abs(ldls.stages.ground(points, CAMERA, local_ground=False)).max() < 0.08


def test_the_ground_is_within_30_cm_below_and_15_above():
    heights = [-0.31, -0.29, 0, 0.14, 0.16, np.nan]
    assert ldls.stages.on_ground(heights).tolist() == [False, True, True, True, False, False]


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(np.zeros((0, 3)), id="no point"),
        pytest.param(np.zeros((50, 3)), id="all in one place"),
        pytest.param(random_cloud(1, 11), id="fewer points than cells needed"),
        pytest.param(random_cloud(2) * [1, 1, 1e3], id="nowhere level"),
    ],
)
def test_clouds_without_ground_have_no_heights(points):
    heights = ldls.stages.ground(points, CAMERA)
    assert heights.shape == (len(points),)
    assert np.isnan(heights).all()


@pytest.mark.parametrize("local", [False, True], ids=["smooth", "local"])
def test_neither_order_nor_threads_change_a_bit(local):
    points = np.concatenate([sloping_road(seed)[0] + [0, 1e-3 * seed, 0] for seed in range(3)])
    heights = ldls.stages.ground(points, CAMERA, local_ground=local, threads=1)
    order = np.random.default_rng(0).permutation(len(points))
    for threads, rows in itertools.product((1, 2, 3), (np.arange(len(points)), order)):
        again = ldls.stages.ground(points[rows], CAMERA, local_ground=local, threads=threads)
        assert np.array_equal(again, heights[rows], equal_nan=True)
