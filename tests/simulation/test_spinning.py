"""Sweeps that take their time: moved back point by point, they are those of a rig that stands still."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("embreex")

import ldls
from ldls.camera.rigid import inverse
from ldls.datasets import odometry_of, open_source
from ldls.simulation import LIDARS, Drive, SensorErrors, drive_folder, drive_frame, robot_drive, write_drive
from ldls.simulation.drives import ROBOT_SPEED_M_S, drive_poses, poses_after
from ldls.simulation.moving_caster import MovingCaster
from ldls.simulation.raycasting import RayCaster
from ldls.simulation.scanning import Motion, scan_moving
from ldls.simulation.scene_object import CAR, SceneObject
from ldls.simulation.scenes import Scene, make_scene
from ldls.simulation.shapes.primitives import box
from ldls.simulation.shapes.shape import join

TURNS = Drive(n_frames=11, seed=0, lidar="vlp-16", camera="robot", turn_deg_s=60.0, spinning=True)
NUMBER = 10
"""A frame after 60 degrees, in which a car of 8.8 m/s has a thousand points, a third of a metre from the stamp."""
EXACT = replace(
    LIDARS["vlp-16"], firings=900, dropout=0.0, sensitivity=1e9, range_noise_m=0.0, range_step_m=0.0, max_range_m=200.0
)
"""Reports every return where it is."""


@pytest.fixture(scope="module")
def frame():
    return drive_frame(TURNS, NUMBER)


def moved_back(frame):
    """Points of a frame in coordinates of the lidar at its stamp."""
    since = 0.1 * NUMBER
    poses = inverse(poses_after(TURNS, np.array([since]))[0]) @ poses_after(TURNS, since + frame.times)
    return np.einsum("nij,nj->ni", poses[:, :3, :3], frame.points[:, :3]) + poses[:, :3, 3]


def test_the_lidar_turns_clockwise_and_looks_ahead_at_the_stamp(frame):
    assert frame.times.dtype == np.float64 and frame.times.shape == (len(frame.points),)
    assert np.all(np.diff(frame.times) >= 0)
    assert frame.times[0] == -0.05 and 0.049 < frame.times[-1] < 0.05
    x, y = frame.points[:, :2].astype(float).T
    np.testing.assert_allclose(-np.arctan2(y, x) / (2 * np.pi) * 0.1, frame.times, atol=1e-8)


def test_poses_are_those_at_the_stamps():
    poses = drive_poses(TURNS)
    np.testing.assert_array_equal(poses_after(TURNS, 0.1 * np.arange(11.0)), poses)
    np.testing.assert_array_equal(drive_frame(TURNS, 1).pose, poses[1])
    before, after = poses_after(TURNS, np.array([-0.05, 0.05]))
    assert before[0, 3] == pytest.approx(-after[0, 3])
    assert np.arctan2(after[1, 0], after[0, 0]) == pytest.approx(np.radians(3))


def beyond_box_m(points, thing, way_m):
    """How far points (n, 3) lie outside the box of an object that has gone `way_m` (n, 3) since."""
    c, s = np.cos(thing.yaw), np.sin(thing.yaw)
    within = np.abs((points - thing.centre_m - way_m) @ [[c, -s, 0], [s, c, 0], [0, 0, 1]])
    half = np.array([thing.length_m, thing.width_m, thing.height_m]) / 2
    return np.linalg.norm(np.maximum(within - half, 0), axis=1)


def test_points_of_objects_lie_where_these_are_at_their_time(frame):
    points = moved_back(frame)
    wrong, n_still, n_moving = [], 0, 0
    for number, thing in enumerate(frame.objects, start=1):
        own = frame.truth.instances == number
        way = np.outer(frame.times[own], [*thing.velocity_m_s, 0])
        # the range's noise is 15 mm, and the ground rises under what moves
        assert np.all(beyond_box_m(points[own], thing, way) < 0.08)
        wrong.append(beyond_box_m(frame.points[own, :3], thing, way))
        if thing.velocity_m_s == (0, 0):
            n_still += own.sum()
        else:
            n_moving += own.sum()
            wrong.append(beyond_box_m(points[own], thing, np.zeros(3))[np.abs(frame.times[own]) > 0.02])
    assert n_still > 200 and n_moving > 200
    assert np.mean(np.concatenate(wrong) > 0.08) > 0.1


def test_images_see_what_stands_still_where_the_calibration_says(frame):
    (image,) = frame.images
    assert frame.stamp - image.stamp == pytest.approx(0.03) and image.moved
    still = [m for m, thing in enumerate(frame.objects, start=1) if thing.velocity_m_s == (0, 0)]
    chosen = np.isin(frame.truth.instances, still)
    shares = []
    for points in (
        moved_back(frame),
        frame.points[:, :3],
    ):
        size = image.pixels.instances.shape
        seen, pixels = ldls.stages.project(points[chosen], image.true_camera, image_size=size)
        u, v = np.floor(pixels + 0.5).astype(int).T
        shares.append(np.mean(image.pixels.instances[v, u] == frame.truth.instances[chosen][seen]))
    # cameras see panes where lasers go through
    assert shares[0] > 0.85
    assert shares[1] < shares[0] - 0.1


def room() -> Scene:
    """Ground, four walls 20 m away, and a car that comes from behind."""
    grey = (0.5, 0.5, 0.5)
    walls = [box((x, 0, 3), (0.2, 40, 6), grey) for x in (-20.1, 20.1)]
    walls += [box((0, y, 3), (40, 0.2, 6), grey) for y in (-20.1, 20.1)]
    parts = [box((0, 0, -0.5), (60, 60, 1), grey), *walls, box((-8, 6, 0.75), (4, 2, 1.5), grey)]
    counts = [len(part.faces) for part in parts]
    objects = np.repeat(np.array([0] * 5 + [1], np.int32), counts)
    car = SceneObject(CAR, (-8, 6, 0.75), 4, 2, 1.5, 0.0, (12.0, -9.0))
    return Scene(join(parts), objects, CAR * objects, (car,))


def test_without_noise_every_point_lies_on_its_surface():
    times = EXACT.firing_times(0.1)
    yaw, rig = 1.5 * times, np.tile(np.eye(4), (len(times), 1, 1))
    rig[:, 0, 0] = rig[:, 1, 1] = np.cos(yaw)
    rig[:, 1, 0], rig[:, 0, 1] = np.sin(yaw), -np.sin(yaw)
    rig[:, :3, 3] = np.outer(times, [8.0, 3.0, 0.4])
    ways = np.outer(times, [12.0, -9.0, 0])[None]
    sweep = scan_moving(room(), EXACT, 1.5, Motion(times, rig, ways), np.random.default_rng(0))
    at = np.searchsorted(times, sweep.times)
    np.testing.assert_array_equal(times[at], sweep.times)
    lidar = sweep.points[:, :3] + np.array([0, 0, 1.5])
    points = np.einsum("nij,nj->ni", rig[at, :3, :3], lidar) + rig[at, :3, 3]
    car = sweep.instances == 1
    assert 50 < car.sum() < 5000 and len(car) > 8000
    assert off_m(points[~car], car=False).max() < 1e-4
    assert off_m(points[car] - ways[0, at[car]], car=True).max() < 1e-4
    assert np.median(off_m(lidar[~car], car=False)) > 0.01 and off_m(lidar[~car], car=False).max() > 0.5
    assert np.median(off_m(points[car], car=True)) > 0.1


def off_m(points, *, car):
    """Distance of points to the nearest of the planes of the room, or of the car at the stamp."""
    if car:
        planes = np.abs(np.abs(points - [-8, 6, 0.75]) - [2, 1, 0.75])
    else:
        planes = np.abs(np.column_stack([np.abs(points[:, :2]) - 20, points[:, 2]]))
    return planes.min(axis=1)


def test_rays_meet_what_a_scene_rebuilt_for_each_moment_has():
    scene, rng = make_scene(5), np.random.default_rng(1)
    times = np.linspace(-1, 1, 5)
    ways = np.array(
        [np.outer(times, [*thing.velocity_m_s, 0.1 * (thing.velocity_m_s != (0, 0))]) for thing in scene.objects]
    )
    caster = MovingCaster(scene, ways)
    directions = rng.normal(size=(20_000, 3)) * [1, 1, 0.1]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = rng.uniform([-0.3, -0.3, 1.5], [0.3, 0.3, 1.9], (len(directions), 3))
    moments = rng.integers(5, size=len(directions))
    ranges, faces = caster.first_hits(origins, directions, moments)
    n_moving = 0
    for moment in range(5):
        moved = scene.moved(np.vstack([np.zeros(3), ways[:, moment]]))
        slow, own = RayCaster(moved.shape), moments == moment
        expected, expected_faces = slow.first_hits(origins[own], directions[own])
        same = faces[own] == expected_faces
        assert same.mean() > 0.999, "edges of triangles apart"
        np.testing.assert_allclose(ranges[own][same], expected[same], atol=1e-5)
        np.testing.assert_allclose(caster.normals, slow.normals, atol=1e-9)
        hit = faces[own] >= 0
        n_moving += np.isin(scene.face_objects[faces[own][hit]], np.flatnonzero(ways.any(axis=(1, 2))) + 1).sum()
    assert n_moving > 100


def test_a_drive_in_the_raw_layout_has_begin_and_end_of_its_turns(tmp_path):
    drive = replace(TURNS, n_frames=2)
    assert None not in list(write_drive(tmp_path, drive))
    path = drive_folder(tmp_path, drive)
    at, begin, end = (
        np.array((path / f"velodyne_points/timestamps{name}.txt").read_text().split("\n")[:2], "datetime64[ns]")
        for name in ("", "_start", "_end")
    )
    assert list(at - begin) == list(end - at) == [np.timedelta64(50_000_000, "ns")] * 2
    np.testing.assert_array_equal(open_source(path)[1].points[:, :3], drive_frame(drive, 1).points[:, :3])
    assert list(write_drive(tmp_path, drive)) == [None, None]
    with pytest.raises(ldls.ParameterError, match='"spinning": true\', expected \'"spinning": false'):
        list(write_drive(tmp_path, replace(drive, spinning=False)))


def test_sweeps_of_one_instant_have_no_turns(tmp_path):
    drive = replace(TURNS, n_frames=1, spinning=False)
    started = write_drive(tmp_path, replace(drive, spinning=True), processes=0)
    with pytest.raises(ldls.ParameterError, match="processes"):
        next(started)  # stopped before its first frame
    assert None not in list(write_drive(tmp_path, drive))
    path = drive_folder(tmp_path, drive)
    assert not list((path / "velodyne_points").glob("timestamps_*"))
    assert drive_frame(drive, 0).times is None
    with pytest.raises(ldls.ParameterError, match='"spinning": false\', expected \'"spinning": true'):
        list(write_drive(tmp_path, replace(drive, spinning=True)))


def test_a_drive_without_delay_takes_its_images_where_it_takes_its_sweeps():
    still = replace(TURNS, sensors=SensorErrors.none(), spinning=False)
    one, other = (drive_frame(drive, 1).images[0] for drive in (still, replace(still, spinning=True)))
    np.testing.assert_array_equal(one.read(), other.read())
    np.testing.assert_allclose(one.camera.T_camera_lidar, other.camera.T_camera_lidar, atol=1e-12)


@pytest.fixture(scope="module")
def robot():
    return list(robot_drive(2, spinning=True))


def test_a_robot_s_sweeps_take_their_time(robot):
    frame, still = robot[0], next(robot_drive(1))
    assert still.times is None and frame.times.min() == -0.05
    points = frame.points[:, :3].astype(float)
    points[:, 0] += ROBOT_SPEED_M_S * frame.times
    n_seen = 0
    for number, thing in enumerate(frame.objects, start=1):
        own = frame.truth.instances == number
        way = np.outer(frame.times[own], [*thing.velocity_m_s, 0])
        assert np.all(beyond_box_m(points[own], thing, way) < 0.06)
        n_seen += own.sum()
    assert n_seen > 200
    assert [thing.centre_m for thing in frame.objects] == [thing.centre_m for thing in still.objects]


def test_points_of_a_robot_s_bag_have_their_time(robot, tmp_path):
    pytest.importorskip("rosbags")
    from ldls.datasets import RosBag
    from ldls.simulation import write_robot_drive

    with RosBag(write_robot_drive(tmp_path, "mcap", frames=2, spinning=True), world="odom") as bag:
        for number, frame in enumerate(robot):
            times = bag.cloud(number).fields["time"]
            assert times.dtype == np.float32
            np.testing.assert_allclose(times, frame.times, atol=1e-8)
            np.testing.assert_array_equal(bag[number].points[:, :3], frame.points[:, :3])
            assert bag[number].pose[0, 3] == pytest.approx(frame.pose[0, 3], abs=1e-6)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("seed", -1, "0 or more"),
        ("n_frames", 2.5, "a whole number"),
        ("turn_deg_s", "x", "a finite number"),
        ("spinning", "no", "True or False"),
    ],
)
def test_a_drive_refuses_what_it_cannot_be_made_of(name, value, expected):
    with pytest.raises(ldls.ParameterError, match=f"{name}: got {value!r}, expected {expected}"):
        Drive(**{name: value})


def test_what_is_no_trajectory_and_no_drive_is_refused(frame):
    with pytest.raises(ldls.InputError, match="trajectory: expected Trajectory, got str"):
        frame.deskewed("poses.txt")
    with pytest.raises(ldls.InputError, match="source: got str, expected a drive as ldls.datasets.open_source opens"):
        odometry_of("drive")
