"""Frames: their truth is consistent, seeds decide everything, sensor errors do what they say."""

import numpy as np
import pytest

from ldls.errors import ParameterError
from ldls.simulation import SegmenterErrors, SensorErrors, SimulatedFrame, make_rig, make_scene, scene_frame
from ldls.simulation.scene_object import CLASS_NAMES, CYCLIST
from ldls.stages import project

PERFECT = {"segmenter": SegmenterErrors.none(), "sensors": SensorErrors.none()}


@pytest.fixture(scope="module", params=["street", "campus"])
def frame(request: pytest.FixtureRequest) -> SimulatedFrame:
    return scene_frame(11, kind=request.param, **PERFECT)


def pixel_instances(frame: SimulatedFrame) -> tuple[np.ndarray, np.ndarray]:
    """Object of the pixel nearest to each point in view, and object of the point."""
    (image,) = frame.images
    in_view, pixels = project(frame.points, image.camera, image_size=image.camera.image_size)
    column, row = np.floor(np.asarray(pixels) + 0.5).astype(int).T
    return image.pixels.instances[row, column], frame.truth.instances[in_view]


def test_arrays_have_the_documented_shapes(frame):
    n = len(frame.points)
    assert 100_000 < n < 64 * 2083
    assert frame.points.dtype == np.float32 and frame.points.shape == (n, 4)
    assert frame.truth.instances.shape == frame.truth.classes.shape == frame.rings.shape == (n,)
    image = frame.images[0].read()
    assert image.shape == (375, 1242, 3) and image.dtype == np.uint8
    assert ((frame.points[:, 3] >= 0) & (frame.points[:, 3] <= 1)).all()


def test_classes_are_those_of_the_objects(frame):
    of_object = np.array(["background", *(CLASS_NAMES[o.category] for o in frame.objects)])
    np.testing.assert_array_equal(np.array(frame.truth.names)[frame.truth.classes], of_object[frame.truth.instances])
    assert not frame.truth.ignored.any()


def test_an_image_is_read_anew_each_time(frame):
    (image,) = frame.images
    image.read()[:] = 0
    assert image.read().any()


def test_points_and_pixels_agree_on_their_objects(frame):
    seen, truth = pixel_instances(frame)
    assert (seen == truth).mean() > 0.93
    assert (seen == truth)[truth > 0].mean() > 0.85


def test_points_of_an_object_lie_in_its_box(frame):
    for m, thing in enumerate(frame.objects, start=1):
        offset = frame.points[frame.truth.instances == m, :3] - np.array(thing.centre_m)
        c, s = np.cos(thing.yaw), np.sin(thing.yaw)
        local = np.abs(offset @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
        assert (local <= np.array([thing.length_m, thing.width_m, thing.height_m]) / 2 + 0.12).all()


def test_objects_do_not_stand_in_one_another(frame):
    things = [o for o in frame.objects if o.category in (3, 6, 8)]
    for i, one in enumerate(things):
        for other in things[i + 1 :]:
            assert np.hypot(*np.subtract(one.centre_m, other.centre_m)[:2]) > 1.8


def test_scenes_hold_ten_categories_and_cyclists():
    found = {
        o.category for kind in ("street", "campus") for seed in range(12) for o in make_scene(seed, kind=kind).objects
    }
    assert found == {1, 2, 3, 4, 6, 8, 15, 18, 62, 64, CYCLIST}


def test_a_seed_is_a_frame():
    first, again, other = scene_frame(5), scene_frame(5), scene_frame(6)
    np.testing.assert_array_equal(first.points, again.points)
    one, same, another = (frame.images[0] for frame in (first, again, other))
    np.testing.assert_array_equal(one.read(), same.read())
    np.testing.assert_array_equal(one.masks.to_array(), same.masks.to_array())
    np.testing.assert_array_equal(one.camera.T_camera_lidar, same.camera.T_camera_lidar)
    assert first.objects == again.objects
    assert not np.array_equal(one.read(), another.read())


def test_perfect_sensors_give_the_true_calibration(frame):
    (image,) = frame.images
    np.testing.assert_allclose(image.camera.T_camera_lidar, image.true_camera.T_camera_lidar, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_calibration_is_off_by_the_strengths(seed):
    errors = SensorErrors(rotation_deg=0.7, translation_m=0.05, delay_s=0)
    error = errors.drift(seed)
    angle = np.degrees(np.arccos((np.trace(error[:3, :3]) - 1) / 2))
    assert angle == pytest.approx(0.7)
    assert np.linalg.norm(error[:3, 3]) == pytest.approx(0.05)
    np.testing.assert_allclose(error[:3, :3] @ error[:3, :3].T, np.eye(3), atol=1e-12)


def test_delay_moves_what_moves_and_nothing_else():
    still, late = (
        scene_frame(
            11, segmenter=SegmenterErrors.none(), sensors=SensorErrors(rotation_deg=0, translation_m=0, delay_s=s)
        )
        for s in (0.0, 0.2)
    )
    np.testing.assert_array_equal(still.images[0].read(), late.images[0].read())
    np.testing.assert_array_equal(still.images[0].pixels.instances, late.images[0].pixels.instances)
    assert (late.stamp, late.images[0].stamp) == (0.2, 0.0)
    for before, after in zip(still.objects, late.objects, strict=True):
        moved = np.subtract(after.centre_m, before.centre_m)
        np.testing.assert_allclose(moved, [*(0.2 * v for v in before.velocity_m_s), 0], atol=1e-9)
    counts = np.bincount(still.truth.instances, minlength=len(still.objects) + 1)[1:]
    fast = np.argmax(counts * [np.hypot(*o.velocity_m_s) for o in still.objects]) + 1
    before, after = (f.points[f.truth.instances == fast, :3].mean(axis=0) for f in (still, late))
    shift = after - before
    np.testing.assert_allclose(shift[:2], 0.2 * np.array(still.objects[fast - 1].velocity_m_s), atol=0.5)


def test_windows_let_a_laser_through(frame):
    seen, truth = pixel_instances(frame)
    cars = np.array([0, *(o.category == 3 for o in frame.objects)], bool)
    behind = cars[seen] & (truth != seen)
    assert 0.02 < behind.sum() / cars[seen].sum() < 0.5


@pytest.mark.parametrize(
    ("lidar", "camera"),
    [
        pytest.param("vlp-16", "robot", id="robot"),
        pytest.param("os1-128", "robot", id="OS1"),
    ],
)
def test_other_rigs(lidar, camera):
    frame = scene_frame(1, kind="campus", rig=make_rig(lidar=lidar, camera=camera), **PERFECT)
    assert len(frame.images) == 1
    assert frame.images[0].read().shape == (480, 640, 3)
    seen, truth = pixel_instances(frame)
    assert (seen == truth).mean() > 0.9


def test_unknown_kinds_of_scene_are_refused():
    with pytest.raises(ParameterError, match="street, campus"):
        make_scene(0, kind="jungle")
