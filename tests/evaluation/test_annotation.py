from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls.evaluation import annotate
from ldls.evaluation.annotation import GROUND_THICKNESS_M, ground_plane
from ldls.io.labels import KittiObject, read_kitti_objects

BOX = KittiObject(
    type="Car", truncated=0, occluded=0, alpha=0, bbox=(0, 0, 1, 1),
    dimensions=(1.5, 1.6, 4.0), location=(0.0, 1.5, 10.0), rotation_y=0.0,
)  # fmt: skip
# lidar axes as the camera's: x right, y down, z forward
CAMERA = ldls.Camera(projection=[[100.0, 0, 200], [0, 100, 100], [0, 0, 1]], image_size=(200, 400))


def ground(slope=0.0, lift=0.0):
    """A grid of returns around and under the box; height above its bottom is `lift` + `slope` * x."""
    x, z = (grid.ravel() for grid in np.meshgrid(np.arange(-4, 4.01, 0.2), np.arange(7, 13.01, 0.2)))
    return np.stack([x, 1.5 - lift - slope * x, z], axis=1)


def body(bottom=0.4):
    """Returns from the side of the car, from `bottom` metres above its ground up."""
    x, up = (grid.ravel() for grid in np.meshgrid(np.arange(-1.8, 1.81, 0.1), np.arange(bottom, 1.4, 0.1)))
    return np.stack([x, 1.5 - up, np.full(x.shape, 9.5)], axis=1)


@pytest.mark.parametrize(
    ("slope", "lift"),
    [
        pytest.param(0.0, 0.05, id="level"),
        pytest.param(0.05, 0.12, id="sloping"),
        pytest.param(0.0, -0.2, id="below the box"),
    ],
)
def test_the_ground_under_an_object_leaves_it_and_nothing_else(slope, lift):
    points = np.vstack([ground(slope, lift), body()])
    n_body = len(body())
    before = annotate([BOX], points, CAMERA, clean=False).labeling
    made = annotate([BOX], points, CAMERA)
    assert made.labeling.classes[-n_body:].all()
    assert not made.labeling.classes[:-n_body].any()
    assert made.n_ground == np.count_nonzero(before.classes) - n_body
    assert (made.labeling.instances > 0).sum() == n_body
    assert made.objects() == {"Car": 1}


def test_walls_and_kerbs_do_not_lift_the_ground():
    x, up = (grid.ravel() for grid in np.meshgrid(np.arange(-3, 3.01, 0.1), np.arange(0.0, 3.0, 0.1)))
    wall = np.stack([x, 1.5 - up, np.full(x.shape, 11.5)], axis=1)
    height, along, across = ground_plane(np.vstack([ground(0.04), wall]), BOX)
    assert height == pytest.approx(0, abs=0.03)
    assert along == pytest.approx(0.04, abs=0.01)
    assert across == pytest.approx(0, abs=0.05)


def test_without_returns_around_it_an_object_stands_on_its_box():
    assert ground_plane(np.zeros((0, 3)), BOX).tolist() == [0, 0, 0]
    up = np.array([0.0, GROUND_THICKNESS_M - 0.01, GROUND_THICKNESS_M + 0.01, 1.0])
    points = np.stack([np.zeros(4), 1.5 - up, np.full(4, 10.0)], axis=1)
    assert annotate([BOX], points, CAMERA).labeling.classes.tolist() == [0, 0, 1, 1]


def test_a_turned_box_tilts_with_the_road():
    turned = replace(BOX, rotation_y=np.pi / 2)
    height, along, across = ground_plane(ground(0.05), turned)
    assert (height, along) == pytest.approx((0, 0), abs=0.01)
    assert across == pytest.approx(0.05, abs=0.01)


def test_real_objects_lose_their_ground_and_keep_the_rest(data_folder):
    training = data_folder / "kitti/training"
    points = ldls.read_points(training / "velodyne/000003.bin")
    camera = ldls.read_camera(training / "calib/000003.txt")
    objects = read_kitti_objects(training / "label_2/000003.txt")
    whole = annotate(objects, points, camera, clean=False)
    cleaned = annotate(objects, points, camera)
    assert whole.n_ground == 0
    assert 0 < cleaned.n_ground < 0.1 * whole.labeling.counts()["Car"]
    left = (whole.labeling.classes > 0) & (cleaned.labeling.classes == 0)
    assert left.sum() == cleaned.n_ground
    kept = cleaned.labeling.instances > 0
    assert points[left, 2].max() < np.median(points[kept, 2])


def test_frames_without_objects_and_points_without_coordinates():
    points = np.vstack([ground(0.0, 0.05), body(), np.full((1, 3), np.nan), [[np.inf, -np.inf, np.inf]]])
    assert annotate([], points, CAMERA).objects() == {}
    made = annotate([BOX], points, CAMERA)
    assert made.labeling.ignored[-2:].all()
    assert (made.labeling.instances > 0).sum() == len(body())
