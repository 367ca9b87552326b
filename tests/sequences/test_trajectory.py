"""Trajectories: poses between poses, against SciPy's slerp, and what is refused."""

import copy
import pickle
import re
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from ldls import DtypeError, PoseError, ShapeError, Sweep, Trajectory
from ldls.camera.rigid import to_quaternion
from ldls.errors import PrecisionWarning
from ldls.sequences.trajectory import LONGEST_GAP_S

START_S = 1_317_042_145.951199
"""A stamp since 1970, which has few digits left behind the point."""


def drive(n=6, *, seed=0, period_s=0.1):
    """Poses at random, but no faster than a car."""
    generator = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    poses[:, :3, 3] = np.cumsum(generator.uniform(-2, 2, (n, 3)), axis=0)
    return START_S + period_s * np.arange(n), poses


def moved(metres, yaw_deg=0.0):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix()
    pose[0, 3] = metres
    return pose


@pytest.mark.parametrize("seed", range(5))
def test_poses_between_poses_are_those_of_an_independent_slerp(seed):
    stamps, poses = drive(seed=seed)
    trajectory, slerp = Trajectory(stamps, poses), Slerp(stamps, Rotation.from_matrix(poses[:, :3, :3]))
    for stamp in np.random.default_rng(seed).uniform(stamps[0], stamps[-1], 20):
        pose = trajectory.at(stamp)
        np.testing.assert_allclose(pose[:3, :3], slerp(stamp).as_matrix(), atol=1e-9)
        expected = [np.interp(stamp, stamps, poses[:, axis, 3]) for axis in range(3)]
        np.testing.assert_allclose(pose[:3, 3], expected, atol=1e-9)
        assert pose[3].tolist() == [0, 0, 0, 1]


def test_a_pose_at_its_own_stamp_is_that_pose_and_a_copy():
    stamps, poses = drive()
    trajectory = Trajectory(stamps, poses)
    for stamp, pose in zip(stamps, poses, strict=True):
        at = trajectory.at(float(stamp))
        assert np.array_equal(at, pose)
        at[0, 3] = 99
    assert np.array_equal(trajectory.poses, poses)


def test_half_a_turn_is_no_special_case():
    trajectory = Trajectory([0, 1], [moved(0), moved(1, 180)])
    np.testing.assert_allclose(np.abs(trajectory.at(0.5)), np.abs(moved(0.5, 90)), atol=1e-12)


def test_beyond_the_ends_the_motion_goes_on_for_half_a_period():
    trajectory = Trajectory([10, 10.1, 10.2], [moved(0), moved(1, 2), moved(3, 6)])
    assert trajectory.margin_s == pytest.approx(0.05)
    np.testing.assert_allclose(trajectory.at(9.96), moved(-0.4, -0.8), atol=1e-9)
    np.testing.assert_allclose(trajectory.at(10.24), moved(3.8, 7.6), atol=1e-9)
    for stamp in (9.94, 10.26):
        with pytest.raises(PoseError, match=rf"no pose at {stamp:.6f} s, poses are from 10.000000 to 10.200000 s"):
            trajectory.at(stamp)


def test_within_a_gap_there_is_no_pose():
    trajectory = Trajectory([0, 0.1, 0.1 + LONGEST_GAP_S + 0.01, 1.2], [moved(x) for x in range(4)])
    trajectory.at(0.05), trajectory.at(1.15), trajectory.at(0.1 + LONGEST_GAP_S + 0.01)
    with pytest.raises(PoseError, match=r"no pose at 0\.600000 s, .* a gap of 1\.010 s from 0\.100000 to 1\.110000 s"):
        trajectory.at(0.6)
    assert np.array_equal(Trajectory([0, LONGEST_GAP_S], [moved(0), moved(1)]).at(0.5), moved(0.5))


@pytest.mark.parametrize("clock", [0.1, 0.7, 1e9 + 0.1, 1767700800.3, 1 / 3])
def test_there_are_poses_between_those_a_second_apart_whatever_rounding_does(clock):
    stamps = [round(clock + k, 6) for k in range(50)]
    trajectory = Trajectory(stamps, [moved(k) for k in range(50)])
    points = np.array([[1.0, 0, 0], [2.0, 0, 0]], np.float32)
    for one, other in pairwise(stamps):
        trajectory.at((one + other) / 2)
        trajectory.motion(one, other)
        trajectory.deskew(points, np.array([0, other - one]), one)


def test_nor_does_motion_over_a_gap_go_on():
    with pytest.raises(PoseError, match="gap of 3.000 s"):
        Trajectory([0, 3], [moved(0), moved(1)]).at(3.1)


def test_one_pose_holds_at_its_stamp_alone():
    trajectory = Trajectory([5], [moved(3)])
    assert len(trajectory) == 1 and trajectory.at(5)[0, 3] == 3
    with pytest.raises(PoseError, match="no pose at 5.1"):
        trajectory.at(5.1)


def test_a_trajectory_is_a_copy_that_nobody_changes_and_travels():
    stamps, poses = drive()
    trajectory = Trajectory(stamps, poses)
    poses[:], stamps[:] = 0, 0
    with pytest.raises(ValueError, match="read-only"):
        trajectory.poses[0] = 0
    for other in (copy.deepcopy(trajectory), pickle.loads(pickle.dumps(trajectory))):
        assert np.array_equal(other.at(START_S + 0.123), trajectory.at(START_S + 0.123))


def mirrored():
    pose = moved(0)
    pose[1, 1] = -1
    return pose


@pytest.mark.parametrize(
    ("stamps", "poses", "error", "message"),
    [
        pytest.param([], np.zeros((0, 4, 4)), PoseError, "expected at least one", id="none"),
        pytest.param([0], [moved(0), moved(1)], PoseError, "there are 1 for 2 poses", id="fewer stamps"),
        pytest.param([0, 1], np.zeros((2, 3, 4)), ShapeError, "poses: expected shape (n, 4, 4)", id="without last row"),
        pytest.param([0, 0], [moved(0), moved(0)], PoseError, "pose 0 has 0.000000 s and pose 1 0.0", id="twice"),
        pytest.param([1, 0], [moved(0), moved(0)], PoseError, "expected ascending", id="backwards"),
        pytest.param([0, np.nan], [moved(0), moved(0)], PoseError, "pose 1: got nan, expected seconds", id="NaN stamp"),
        pytest.param([1.7e18, 1.7e18 + 1e9], [moved(0), moved(0)], PoseError,
                     "stamps: pose 1: got 1.700000001e+18, expected seconds below 9.2e+09;", id="nanoseconds"),
        pytest.param([0, 1], [moved(0), moved(np.nan)], PoseError, "pose 1 at 1.000000 s is not finite", id="NaN"),
        pytest.param([0, 1], [moved(0), mirrored()], PoseError, "pose 1 at 1.000000 s: the det", id="mirror"),
        pytest.param([0, 1], [moved(0), 1.1 * moved(0)], PoseError, "pose 1 at 1.000000 s: R^T R", id="scaled"),
        pytest.param([0, 1], [moved(0), moved(5).T], PoseError, "transposed?", id="transposed"),
        pytest.param([0, 0.1, 0.2], [moved(0), moved(9.9), moved(20)], PoseError,
                     "from 0.100000 to 0.200000 s the lidar moves 10.1 m in 0.1 s, expected at most 100", id="jump"),
        pytest.param([0, 1], [moved(0), np.eye(4) + 101 * np.eye(4)[[2]].T @ np.eye(4)[[3]]], PoseError,
                     "the lidar moves 101 m", id="jump upwards"),
        pytest.param([0, 1], [moved(-1e308), moved(1e308)], PoseError, "the lidar moves inf m", id="jump over all"),
    ],
)  # fmt: skip
def test_what_cannot_be_the_way_of_a_lidar_is_refused(stamps, poses, error, message):
    with pytest.raises(error, match=re.escape(message)):
        Trajectory(stamps, np.array(poses))


@pytest.mark.parametrize("seed", range(20))
def test_quaternions_of_rotations_are_those_of_scipy(seed):
    rotation = Rotation.random(random_state=seed)
    x, y, z, w = rotation.as_quat(canonical=True)
    np.testing.assert_allclose(to_quaternion(rotation.as_matrix()), [w, x, y, z], atol=1e-12)


def by_pose(trajectory, points, times, stamp):
    """Each point by the poses at its own time and at the stamp, one after the other, in double precision."""
    back = np.linalg.inv(trajectory.at(stamp))
    return np.array(
        [
            (back @ trajectory.at(stamp + t) @ [*xyz, 1])[:3]
            for xyz, t in zip(points[:, :3].astype(float), times, strict=True)
        ]
    )


@pytest.mark.parametrize("period_s", [0.1, 0.013, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_points_are_moved_as_by_the_poses_at_their_times(seed, period_s, monkeypatch):
    monkeypatch.setattr("ldls.sequences.trajectory.BLOCK", 70)
    _, poses = drive(40, seed=seed)
    # from zero, where a float holds moments to a femtosecond
    trajectory = Trajectory(period_s * np.arange(40), slow(poses))
    generator = np.random.default_rng(seed)
    points, times = generator.normal(scale=20, size=(300, 5)), generator.uniform(-0.1, 0.1, 300)
    times[:3] = 0
    stamp = 20.4 * period_s
    moved = trajectory.deskew(points, times, stamp)
    np.testing.assert_allclose(moved[:, :3], by_pose(trajectory, points, times, stamp), atol=1e-9)
    assert np.array_equal(moved[:, 3:], points[:, 3:]) and np.array_equal(moved[:3], points[:3])
    assert np.abs(moved - points).max() > 1
    single = trajectory.deskew(points.astype(np.float32), times, stamp)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, moved, atol=2e-5)


def slow(poses):
    """The same turns, a hundredth of the way."""
    way = poses.copy()
    way[:, :3, 3] *= 0.01
    return way


def scanned(trajectory, stamp, times):
    """The wall x = 10 of the world, as a lidar that moves and turns sees it."""
    side = np.linspace(-8, 8, len(times))
    points = np.empty((len(times), 3))
    for row, (y, t) in enumerate(zip(side, times, strict=True)):
        points[row] = (np.linalg.inv(trajectory.at(stamp + t)) @ [10, y, np.sin(5 * y), 1])[:3]
    return points


def out_of_plane(points):
    """Largest distance of points from their best plane."""
    centred = points - points.mean(axis=0)
    return np.abs(centred @ np.linalg.svd(centred)[2][2]).max()


def test_a_wall_seen_from_a_lidar_that_moves_and_turns_is_flat_again():
    trajectory = Trajectory(START_S + 0.1 * np.arange(6), [moved(1.2 * k, 3 * k) for k in range(6)])
    stamp, times = START_S + 0.2, np.linspace(-0.05, 0.05, 500)
    seen = scanned(trajectory, stamp, times)
    assert out_of_plane(seen) > 0.1
    again = trajectory.deskew(seen, times, stamp)
    assert out_of_plane(again) < 1e-3
    world = again @ trajectory.at(stamp)[:3, :3].T + trajectory.at(stamp)[:3, 3]
    np.testing.assert_allclose(world[:, 0], 10, atol=1e-3)


def test_what_is_not_there_stays_what_it_is_whatever_its_time_and_nothing_that_was_given_changes():
    trajectory = Trajectory([0, 0.1], [moved(0), moved(1)])
    points = np.ones((6, 4), np.float32)
    points[1, :3], points[2, 1], points[3, 2] = 0, np.nan, np.inf
    times = np.array([0.05, np.nan, -1.7e9, 0.05, 0, -0.05])
    before = points.copy()
    moved_points = trajectory.deskew(points, times, 0.05)
    assert np.array_equal(points, before, equal_nan=True)
    assert np.array_equal(moved_points[1:5], before[1:5], equal_nan=True)
    np.testing.assert_allclose(moved_points[[0, 5], 0], [1.5, 0.5], atol=1e-6)
    same = trajectory.deskew(points[:1], [0], 50.0)
    assert np.array_equal(same, points[:1]) and not np.shares_memory(same, points)
    assert trajectory.deskew(points[:0], [], 0).shape == (0, 4)


@pytest.mark.parametrize(("period_s", "reach_s"), [(0.1, 0.15), (0.01, 0.105), (0.4, 0.6)])
def test_motion_goes_on_for_a_turn_farther_than_poses_are_told(period_s, reach_s):
    trajectory = Trajectory(10 + period_s * np.arange(3), [moved(k, 2 * k) for k in np.arange(3) * period_s])
    last = float(trajectory.stamps[-1])
    for stamp, t in ((last, reach_s - 1e-6), (10.0, -reach_s + 1e-6)):
        start, end = moved(stamp - 10, 2 * (stamp - 10)), moved(stamp - 10 + t, 2 * (stamp - 10 + t))
        expected = (np.linalg.inv(start) @ end @ [1, 2, 3, 1])[:3]
        np.testing.assert_allclose(trajectory.deskew(np.array([[1.0, 2, 3]]), [t], stamp)[0], expected, atol=1e-9)
        np.testing.assert_allclose(trajectory.motion(stamp + t, stamp) @ [1, 2, 3, 1], [*expected, 1], atol=1e-9)
    for stamp, t in ((last, reach_s + 1e-6), (10.0, -reach_s - 1e-6)):
        with pytest.raises(PoseError, match=rf"no pose at {stamp + t:.6f} s, poses are from 10"):
            trajectory.deskew(np.ones((1, 3)), [t], stamp)
        with pytest.raises(PoseError, match="no pose at"):
            trajectory.motion(stamp + t, stamp)


def test_points_of_the_stamp_need_no_motion_and_others_none_of_a_gap():
    points = np.ones((2, 3))
    apart = Trajectory([0, 0.1, 5, 5.1], [moved(x) for x in range(4)])
    np.testing.assert_allclose(apart.deskew(points, [0, -0.05], 0.1)[:, 0], [1, 0.5])
    np.testing.assert_allclose(apart.deskew(points, [0, 0.05], 5)[:, 0], [1, 1.5])
    with pytest.raises(PoseError, match=r"a gap of 4\.900 s from 0\.100000 to 5\.000000 s"):
        apart.deskew(points, [0, 0.05], 0.1)
    alone = Trajectory([1e9], [moved(3)])
    assert np.array_equal(alone.deskew(points, [0, 1e-12], 1e9), points)
    with pytest.raises(PoseError, match="no pose at"):
        alone.deskew(points, [0, 0.05], 1e9)


@pytest.mark.parametrize(
    ("points", "times", "stamp", "error", "message"),
    [
        pytest.param(np.ones((2, 3)), [0.1], 0, ShapeError, "times: there are 1 for 2 points", id="fewer"),
        pytest.param(np.ones((2, 3)), [[0], [0]], 0, ShapeError, "times: expected shape (N,)", id="a column"),
        pytest.param(np.ones((2, 3)), ["a", "b"], 0, DtypeError, "times: expected numbers", id="text"),
        pytest.param(np.ones((2, 3), int), [0, 0], 0, DtypeError, "points: expected float32", id="whole points"),
        pytest.param(np.ones((2, 3)), [0, np.nan], 0, PoseError, "times: a point has nan s", id="NaN"),
        pytest.param(np.ones((2, 3)), [0, 5e7], 0, PoseError,
                     "times: a point has 5e+07 s, expected at most 1 s from the stamp", id="nanoseconds"),
        pytest.param(np.ones((2, 3)), [0, START_S], START_S, PoseError, "give seconds after that stamp", id="absolute"),
        pytest.param(np.ones((2, 3)), [0, 0.01], 7, PoseError, "stamp: no pose at 7.010000 s", id="another drive"),
        pytest.param(np.ones((2, 3)), [0, 0.01], np.nan, PoseError, "no pose at nan", id="no stamp"),
    ],
)  # fmt: skip
def test_times_that_cannot_be_are_refused(points, times, stamp, error, message):
    with pytest.raises(error, match=re.escape(message)):
        Trajectory([0, 0.1], [moved(0), moved(1)]).deskew(points, times, stamp)


def test_moments_a_second_apart_are_of_two_clocks():
    with pytest.raises(PoseError, match=r"start: \+1\.5 s from the other moment, expected at most 1 s"):
        Trajectory([0, 1, 2], [moved(0), moved(1), moved(2)]).motion(1.75, 0.25)


def test_poses_that_single_precision_rounds_are_warned_of():
    poses = np.array([moved(0), moved(1)])
    far = poses.copy()
    far[:, 1, 3] = 5.4e6
    Trajectory([0, 0.1], far)
    Trajectory([0, 0.1], poses.astype(np.float32))
    with pytest.warns(PrecisionWarning, match="^poses: float32 spacing at 5.4e\\+06 is 0.5 m; pass float64") as caught:
        Trajectory([0, 0.1], far.astype(np.float32))
    assert caught[0].filename == __file__
    with pytest.warns(PrecisionWarning, match="^pose: float32 spacing at 5.4e\\+06 is 0.5 m; pass float64"):
        Sweep(np.zeros((0, 3)), [], far[0].astype(np.float32), 0.0)
