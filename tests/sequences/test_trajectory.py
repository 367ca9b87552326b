"""Trajectories: poses between poses, against SciPy's slerp, and what is refused."""

import copy
import pickle
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from ldls import PoseError, ShapeError, Trajectory
from ldls.camera.rigid import to_quaternion
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
        pytest.param([0, np.nan], [moved(0), moved(0)], PoseError, "pose 1 has nan", id="NaN stamp"),
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
