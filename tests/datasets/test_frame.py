"""Frames: what moved during a sweep, and between it and its images."""

import numpy as np
import pytest

import ldls
from conftest import moved
from datasets import layouts
from ldls.datasets import CameraImage, Frame

CAMERA = ldls.Camera(projection=layouts.K, T_camera_lidar=layouts.T, image_size=layouts.SIZE)


def pose(seconds):
    """5 m/s ahead, and 10 degrees a second to the left."""
    return moved(5 * seconds, yaw=np.radians(10 * seconds))


STAMPS = 20 + 0.1 * np.arange(5)
TRAJECTORY = ldls.Trajectory(STAMPS, [pose(stamp - 20) for stamp in STAMPS])


def image(stamp, **options):
    return CameraImage(
        name="front", camera=CAMERA, read=lambda: np.zeros((*layouts.SIZE, 3), np.uint8), stamp=stamp, **options
    )


def frame(**options):
    points = layouts.cloud().astype(float)
    times = np.linspace(-0.05, 0.05, len(points))
    return Frame(**{"name": "a", "points": points, "times": times, "stamp": 20.2, "images": (image(20.23),), **options})


def test_points_are_where_they_were_at_the_stamp_and_cameras_where_they_took_their_images():
    given = frame(images=(image(20.23), image(20.18), image(20.2), image(None)))
    before = given.points.copy()
    deskewed = given.deskewed(TRAJECTORY)
    assert np.array_equal(given.points, before) and given.images[0].camera is CAMERA
    np.testing.assert_array_equal(deskewed.points, TRAJECTORY.deskew(before, given.times, 20.2))
    assert np.abs(deskewed.points - before)[:, :3].max() > 0.2
    assert deskewed.times is None and deskewed.name == "a" and deskewed.stamp == 20.2
    # a place of the world, as the lidar knows it at its stamp and the camera at its own
    place = np.array([3.0, 1, 0.5, 1])
    for seen, stamp in zip(deskewed.images, (20.23, 20.18, 20.2, 20.2), strict=True):
        expected = layouts.T @ np.linalg.inv(pose(stamp - 20)) @ pose(0.2) @ place
        np.testing.assert_allclose(seen.camera.T_camera_lidar @ place, expected, atol=1e-6)
    assert [seen.moved for seen in deskewed.images] == [True, True, True, False]


def test_nothing_is_moved_twice():
    once = frame().deskewed(TRAJECTORY)
    twice = once.deskewed(TRAJECTORY)
    assert np.array_equal(once.points, twice.points)
    assert np.array_equal(once.images[0].camera.T_camera_lidar, twice.images[0].camera.T_camera_lidar)
    own = frame(images=(image(20.23, moved=True),)).deskewed(TRAJECTORY)
    assert np.array_equal(own.images[0].camera.T_camera_lidar, layouts.T)


def test_the_way_that_is_given_goes_before_that_of_the_frame():
    given = frame(trajectory=TRAJECTORY)
    assert np.array_equal(given.deskewed().points, frame().deskewed(TRAJECTORY).points)
    stands = ldls.Trajectory(STAMPS, [np.eye(4)] * 5)
    np.testing.assert_allclose(given.deskewed(stands).points, given.points)


@pytest.mark.parametrize("lacks", [{}, {"stamp": None, "trajectory": TRAJECTORY}])
def test_a_frame_of_which_no_way_or_stamp_is_known_stays_as_it_is(lacks):
    given = frame(**lacks)
    assert given.deskewed() is given


def test_points_without_times_keep_their_bits():
    given = frame(times=None, trajectory=TRAJECTORY)
    assert given.deskewed().points is given.points


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        pytest.param({"times": np.full(100, 5e7)}, ldls.PoseError, "times: a point has 5e.07 s", id="nanoseconds"),
        pytest.param({"times": np.zeros(7)}, ldls.ShapeError, "there are 7 for 100 points", id="fewer times"),
        pytest.param({"images": (image(5.0),)}, ldls.PoseError,
                     r"image of front: start: \+15\.2 s from the other moment", id="another clock"),
    ],
)  # fmt: skip
def test_what_cannot_be_moved_is_an_error_that_says_why(options, error, message):
    with pytest.raises(error, match=message):
        frame(trajectory=TRAJECTORY, **options).deskewed()
