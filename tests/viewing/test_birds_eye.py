"""Bird's-eye views are to scale, turned to the camera, and show boxes and ranges where they are."""

import numpy as np
import pytest

import ldls
from ldls.palette import instance_colours
from ldls.viewing import birds_eye_view
from ldls.viewing.birds_eye import BACKGROUND, DIM, OUT_OF_VIEW, RINGS
from ldls.viewing.drawing import PAPER
from ldls.viewing.ground import ground_of

# camera axes (x right, y down, z forward) of a lidar whose x is forward and z up, and of one whose y is forward
X_FORWARD = [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
Y_FORWARD = [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]

LOW, HIGH = [115, 95, 175, 115], [115, 60, 175, 85]
"""Boxes around slabs of points below the camera and above it, in the image."""


def street(T_camera_lidar) -> ldls.Segmentation:
    """A box 12 m ahead and 3 m to the left on a ground, in the lidar's axes."""
    generator = np.random.default_rng(3)
    ground = generator.uniform([-8, 1.5, 3], [8, 1.6, 25], (3000, 3))
    box = generator.uniform([-4, 0.2, 11], [-2, 1.4, 13], (600, 3))
    behind = generator.uniform([-8, 1.5, -20], [8, 1.6, -3], (1000, 3))
    in_camera = np.vstack([ground, box, behind])
    rotation = np.array(T_camera_lidar, float)[:3, :3]
    points = (in_camera @ rotation).astype(np.float32)
    camera = ldls.Camera(
        projection=[[200, 0, 200], [0, 200, 80], [0, 0, 1]], T_camera_lidar=np.array(T_camera_lidar, float)
    )
    masks = ldls.InstanceMasks.from_boxes([[128, 82, 164, 104]], (160, 400), categories=[3])
    return ldls.segment(points, masks, camera)


@pytest.mark.parametrize(
    "axes", [pytest.param(X_FORWARD, id="x forward"), pytest.param(Y_FORWARD, id="y forward, as in nuScenes")]
)
def test_what_is_ahead_left_of_the_camera_is_up_left_of_the_lidar(axes) -> None:
    result = street(axes)
    picture = np.asarray(birds_eye_view(result))
    ground = ground_of(result)
    (lidar,) = ground.at(np.zeros((1, 2)))
    left, top = np.round(lidar + ground.px_per_m * np.array([-4.5, -13.5])).astype(int)
    right, bottom = np.round(lidar + ground.px_per_m * np.array([-1.5, -10.5])).astype(int)
    coloured = np.abs(picture.astype(int) - instance_colours([3])[0]).max(axis=2) <= 3
    # but for its name
    assert coloured[top:bottom, left:right].sum() > 0.8 * coloured.sum()
    assert coloured[:, int(lidar[0]) :].sum() == 0


def test_a_camera_that_looks_down_takes_x_for_ahead() -> None:
    points = np.random.default_rng(1).uniform([-3, -3, 4], [3, 3, 5], (400, 3)).astype(np.float32)
    masks = ldls.InstanceMasks.from_boxes([[40, 40, 60, 60]], (100, 100), categories=[1])
    camera = ldls.Camera(projection=[[60, 0, 50], [0, 60, 50], [0, 0, 1]])
    np.testing.assert_array_equal(ground_of(ldls.segment(points, masks, camera)).forward, [1, 0])


def test_without_a_view_all_points_are_shown_with_x_ahead() -> None:
    points = np.random.default_rng(1).uniform([-30, -20, 0], [30, 20, 1], (4000, 3)).astype(np.float32)
    result = ldls.segment(points, [])
    ground, picture = ground_of(result), np.asarray(birds_eye_view(result))
    np.testing.assert_array_equal(ground.forward, [1, 0])
    for edge, metres in (("ahead_m", 30), ("behind_m", -30), ("left_m", -20), ("right_m", 20)):
        assert getattr(ground, edge) == pytest.approx(metres, abs=2)
    assert (picture > np.array(PAPER) + 10).all(axis=2).sum() > 4000


def test_a_range_hides_no_object() -> None:
    points = np.random.default_rng(4).uniform([14.8, -0.4, -1], [15.4, 0.4, 1], (500, 3)).astype(np.float32)
    camera = ldls.Camera(projection=[[200, 0, 200], [0, 200, 80], [0, 0, 1]], T_camera_lidar=X_FORWARD)
    masks = ldls.InstanceMasks.from_boxes([[180, 50, 220, 110]], (160, 400), categories=[3])
    result = ldls.segment(points, masks, camera)
    picture = np.asarray(birds_eye_view(result, boxes=False)).astype(int)
    x, y = ground_of(result).at(np.array([[15.1, 0]]))[0].round().astype(int)
    around = picture[y - 5 : y + 6, x - 5 : x + 6]
    assert (np.abs(around - instance_colours([3])[0]).max(axis=2) <= 3).mean() > 0.9


def test_rings_stand_at_their_ranges() -> None:
    result = street(X_FORWARD)
    picture = np.asarray(birds_eye_view(result)).astype(int)
    ground = ground_of(result)
    for range_m in (5, 10):
        # to the left behind nothing is drawn over the ring
        angle = np.radians(np.arange(60, 85))
        places = ground.at(range_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)).astype(int)
        inside = (places >= 1).all(axis=1) & (places[:, 0] < picture.shape[1] - 1)
        drawn = [
            np.abs(picture[y - 1 : y + 2, x - 1 : x + 2] - RINGS).max(axis=2).min() < 25 for x, y in places[inside]
        ]
        assert len(drawn) > 5 and np.mean(drawn) > 0.6


def test_points_in_view_and_out_of_it_are_two_greys() -> None:
    colours, counts = np.unique(
        np.asarray(birds_eye_view(street(X_FORWARD), range_m=60)).reshape(-1, 3), axis=0, return_counts=True
    )
    often = {tuple(colour) for colour in colours[counts > 20].tolist()}
    assert {BACKGROUND, OUT_OF_VIEW} <= often


def test_points_behind_the_object_of_their_mask_are_dim_in_its_colour() -> None:
    # a person, and fewer points on the same mask beyond
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-0.4, 0.4, 20), np.linspace(0.2, 1.2, 20)))
    person, beyond = np.stack([x, y, np.full(400, 10)], axis=1), np.stack([x, y, np.full(400, 19)], axis=1)[::9]
    in_camera = np.vstack([person, beyond])
    points = (in_camera @ np.array(X_FORWARD, float)[:3, :3]).astype(np.float32)
    camera = ldls.Camera(projection=[[200, 0, 200], [0, 200, 80], [0, 0, 1]], T_camera_lidar=np.array(X_FORWARD, float))
    masks = ldls.InstanceMasks.from_boxes([[190, 82, 210, 106]], (160, 400), categories=[1])
    dim = (instance_colours([1])[0] * DIM).astype(int)

    def shows_dim(params: ldls.Params) -> bool:
        result = ldls.segment(points, masks, camera, params=params)
        picture = np.asarray(birds_eye_view(result, range_m=25, boxes=False)).astype(int)
        x, y = np.floor(ground_of(result, 25).at(np.array([[19.0, 0.0]]))[0]).astype(int)
        return bool((np.abs(picture[y - 2 : y + 3, x - 2 : x + 3] - dim).max(axis=2) < 12).any())

    assert shows_dim(ldls.Params())
    assert not shows_dim(ldls.Params.paper())


@pytest.mark.parametrize("first", [pytest.param(0, id="the low first"), pytest.param(1, id="the high first")])
@pytest.mark.parametrize(
    ("masks", "on_top"),
    [
        pytest.param({3: LOW, 1: HIGH}, 1, id="the higher object covers the lower"),
        pytest.param({3: LOW}, 3, id="an object covers background above it"),
    ],
)
def test_the_drawing_has_an_order(first, masks, on_top) -> None:
    # two slabs of points that differ in height only, in either order in the cloud
    x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(-4, -2, 60), np.linspace(11, 13, 60)))
    low, high = (np.stack([x, np.full(x.shape, y), z], axis=1) for y in (1.4, -0.5))
    in_camera = np.vstack([low, high] if first == 0 else [high, low])
    points = (in_camera @ np.array(X_FORWARD, float)[:3, :3]).astype(np.float32)
    camera = ldls.Camera(projection=[[200, 0, 200], [0, 200, 80], [0, 0, 1]], T_camera_lidar=np.array(X_FORWARD, float))
    boxes = ldls.InstanceMasks.from_boxes(list(masks.values()), (160, 400), categories=list(masks))
    result = ldls.segment(points, boxes, camera, params=ldls.Params.paper())
    assert (np.bincount(result.labels, minlength=len(masks) + 1)[1:] == len(x)).all()
    picture = np.asarray(birds_eye_view(result, boxes=False)).astype(int)
    ground = ground_of(result)
    left, top = ground.at(np.array([[12.9, 3.9]]))[0].astype(int)
    right, bottom = ground.at(np.array([[11.1, 2.1]]))[0].astype(int)
    inside = picture[top:bottom, left:right].reshape(-1, 3)
    assert np.abs(inside - instance_colours([on_top])[0]).max(axis=1).mean() < 10


def test_the_picture_fits_and_follows_the_range() -> None:
    result = street(X_FORWARD)
    picture = birds_eye_view(result)
    assert picture.width <= 1800 and picture.height <= 1201
    far, near = ground_of(result, 25.0), ground_of(result, 10.0)
    assert far.ahead_m > near.ahead_m and far.px_per_m < near.px_per_m
    filled = ground_of(result, size_px=(1000, 500), fill=True)
    assert filled.size_px[0] == pytest.approx(1000, abs=1)


def test_boxes_can_be_left_out() -> None:
    result = street(X_FORWARD)
    with_boxes, without = (np.asarray(birds_eye_view(result, boxes=boxes)) for boxes in (True, False))
    assert (with_boxes != without).any()


@pytest.mark.parametrize(("range_m", "is_named"), [(8, False), (14, True)])
def test_an_object_beyond_the_picture_is_not_named_at_its_edge(range_m, is_named) -> None:
    picture = np.asarray(birds_eye_view(street(X_FORWARD), range_m=range_m)).astype(int)
    assert (np.abs(picture - instance_colours([3])[0]).max(axis=2) <= 3).any() == is_named


def test_an_object_that_crosses_the_picture_is_named_though_no_corner_lies_in_it(monkeypatch) -> None:
    train = np.random.default_rng(5).uniform([-20, 0.2, 5], [20, 1.4, 7], (900, 3))
    masks = ldls.InstanceMasks.from_boxes([[0, 0, 399, 159]], (160, 400), categories=[7])
    result = ldls.segment(train, masks, ldls.Camera(projection=[[20, 0, 200], [0, 20, 80], [0, 0, 1]]))
    named = []
    monkeypatch.setattr("ldls.viewing.birds_eye.draw_tags", lambda _, tags, *_others, **_more: named.extend(tags))
    birds_eye_view(result, range_m=6)
    assert [tag.text for tag in named] == ["train 1"]


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(np.zeros((0, 3), np.float32), id="no points"),
        pytest.param(np.full((5, 3), np.nan, np.float32), id="none finite"),
        pytest.param(np.array([[-5, 0, 0]] * 20, np.float32), id="none in view"),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_there_may_be_nothing_to_see(points) -> None:
    masks = ldls.InstanceMasks.from_boxes([[40, 40, 60, 60]], (100, 100), categories=[1])
    camera = ldls.Camera(projection=[[60, 0, 50], [0, 60, 50], [0, 0, 1]], T_camera_lidar=np.array(X_FORWARD, float))
    picture = birds_eye_view(ldls.segment(points, masks, camera))
    assert min(picture.size) > 10


@pytest.mark.parametrize("range_m", [0, -5.0, float("nan")])
def test_a_range_that_shows_nothing_is_refused(range_m) -> None:
    with pytest.raises(ldls.ParameterError, match="range_m: got"):
        birds_eye_view(street(X_FORWARD), range_m=range_m)
