"""The way of a lidar from its sweeps: against true poses of simulated drives, and what is refused."""

import re
import sys
import weakref
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import ldls
from ldls.datasets import odometry_of
from ldls.errors import LdlsWarning
from ldls.simulation import Drive, drive_frame
from ldls.simulation.drives import drive_poses

pytest.importorskip("kiss_icp", reason="the extra odometry is not installed")

DRIVE = Drive(n_frames=20, seed=2, lidar="hdl-64e", turn_deg_s=15.0)
"""Over a slope and to the left."""
N_FRAMES = 8


@cache
def points_of(number):
    return drive_frame(DRIVE, number).points


@pytest.fixture(scope="module")
def sweeps():
    return [(0.1 * number, points_of(number)) for number in range(N_FRAMES)]


@pytest.fixture(scope="module")
def trajectory(sweeps):
    return ldls.odometry(sweeps)


def test_poses_are_those_of_the_drive(trajectory):
    true = drive_poses(DRIVE)[:N_FRAMES]
    assert np.array_equal(trajectory.poses[0], np.eye(4))
    np.testing.assert_allclose(trajectory.stamps, 0.1 * np.arange(N_FRAMES))
    assert np.linalg.norm(true[-1, :3, 3]) > 3
    assert np.linalg.norm(trajectory.poses[:, :3, 3] - true[:, :3, 3], axis=1).max() < 0.04
    turns = Rotation.from_matrix(true[:, :3, :3].transpose(0, 2, 1) @ trajectory.poses[:, :3, :3])
    assert np.degrees(turns.magnitude()).max() < 0.1


def test_the_same_sweeps_give_the_same_bits_whatever_else_the_points_hold(sweeps, trajectory, monkeypatch):
    monkeypatch.setenv("KISS_ICP_DATA", '{"max_range": 5}')
    points = np.column_stack([sweeps[3][1], np.zeros(len(sweeps[3][1]), np.float32)])
    odd = np.full((2, points.shape[1]), np.nan, np.float32)
    odd[1] = 0
    some = [*sweeps[:3], (sweeps[3][0], np.vstack([odd, points]))]
    assert ldls.odometry(iter(some)).poses.tobytes() == trajectory.poses[:4].tobytes()


def test_a_lidar_of_few_lines_does_not_turn_by_itself():
    drive = Drive(n_frames=10, seed=2, lidar="vlp-16", camera="robot", turn_deg_s=20.0)
    found = ldls.odometry((0.1 * k, drive_frame(drive, k).points) for k in range(N_FRAMES))
    true = drive_poses(drive)[:N_FRAMES]
    assert np.linalg.norm(found.poses[:, :3, 3] - true[:, :3, 3], axis=1).max() < 0.06
    turns = Rotation.from_matrix(true[:, :3, :3].transpose(0, 2, 1) @ found.poses[:, :3, :3])
    # not levelled, it pitches by 0.9 degrees
    assert np.degrees(turns.magnitude()).max() < 0.4


def skewed(number):
    """Stamp, points and times of a sweep of the drive, whose lidar turns clockwise while it moves."""
    true = drive_poses(DRIVE)
    stamps = 0.1 * np.arange(len(true))
    points = points_of(number).astype(float)
    times = -np.arctan2(points[:, 1], points[:, 0]) / np.pi * 0.05
    at = stamps[number] + times
    places = np.stack([np.interp(at, stamps, true[:, axis, 3]) for axis in range(3)], axis=1)
    world = points[:, :3] @ true[number, :3, :3].T + true[number, :3, 3]
    points[:, :3] = Slerp(stamps, Rotation.from_matrix(true[:, :3, :3]))(at).inv().apply(world - places)
    return float(stamps[number]), points, times


def test_motion_within_sweeps_whose_points_have_times_is_taken_out():
    sweeps = [skewed(number) for number in range(1, N_FRAMES + 1)]
    true = drive_poses(DRIVE)[1 : N_FRAMES + 1]
    true = np.linalg.inv(true[0]) @ true
    metres, degrees = {}, {}
    for times in (True, False):
        found = ldls.odometry(sweep if times else sweep[:2] for sweep in sweeps).poses
        metres[times] = np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1).mean()
        turns = Rotation.from_matrix(true[:, :3, :3].transpose(0, 2, 1) @ found[:, :3, :3])
        degrees[times] = np.degrees(turns.magnitude()).mean()
    assert metres[True] < 0.02 and degrees[True] < 0.02
    # what does not undo it finds poses that are off
    assert metres[False] > 1.3 * metres[True] and degrees[False] > 3 * degrees[True]


def street(seed=0):
    """Walls to both sides and across, and poles."""
    generator = np.random.default_rng(seed)
    ground = np.column_stack([generator.uniform(-30, 30, (4000, 2)), np.full(4000, -1.7)])
    wall = np.column_stack([generator.uniform(-30, 30, 3000), np.full(3000, 8), generator.uniform(-1.7, 4, 3000)])
    across = np.column_stack([np.full(3000, 25), generator.uniform(-30, 30, 3000), generator.uniform(-1.7, 4, 3000)])
    return np.vstack([ground, wall, across])


NO_PLACE = street() * np.array([0.2, 0.2, 1]) - np.array([70, 30, 0])


@pytest.mark.parametrize(
    ("sweeps", "error", "message"),
    [
        pytest.param([], ldls.InputError, "sweeps: got 0, expected 2 or more", id="none"),
        pytest.param([(0, street())], ldls.InputError, "sweeps: got 1, expected 2 or more", id="one"),
        pytest.param([(0, street()), (0.1, np.full((9, 3), np.nan))], ldls.InputError,
                     "sweep 1: of 9 points 0 are finite, nearer than 100 m and stand, expected 100", id="NaN"),
        pytest.param([(0, np.zeros((0, 3)))], ldls.InputError, "sweep 0: of 0 points", id="empty"),
        pytest.param([(0, street() * [1, 1, 0])], ldls.InputError, "points 0 are finite, nearer", id="flat"),
        pytest.param([(0, street() + np.array([1e30, 0, 0]))], ldls.InputError, "points 0 are finite", id="far"),
        pytest.param([(0, street()), (0, street())], ldls.PoseError,
                     "sweep 1: its stamp 0.000000 s is not after that before it, 0.000000 s; sort them, and leave",
                     id="stamps"),
        pytest.param([(0, street()), (0.1, NO_PLACE)], ldls.PoseError, "sweep 1: the way is lost at 0.1", id="lost"),
        pytest.param([street()], ldls.InputError, "sweep 0 is an array of shape (10000, 3), exp", id="without stamps"),
        pytest.param([(0, street(), [0.0])], ldls.ShapeError, "sweep 0: times: there are 1 for 10000", id="few times"),
        pytest.param([(0, street(), np.full(10000, 5e7))], ldls.PoseError, "sweep 0: times: a point has 5e+07 s",
                     id="nanoseconds"),
        pytest.param([(0, street(), [0.0], 1)], ldls.InputError, "expected (stamp, points) or (stamp, points, times)",
                     id="too many parts"),
        pytest.param([("a", street())], ldls.InputError, "stamp of sweep 0 is 'a', expected seconds", id="text"),
        pytest.param([(np.nan, street())], ldls.InputError, "stamp of sweep 0 is nan", id="NaN stamp"),
        pytest.param([(0, street().astype(int))], ldls.DtypeError, "sweep 0: points: expected float32", id="integers"),
    ],
)  # fmt: skip
def test_what_has_no_way_is_refused(sweeps, error, message):
    with pytest.raises(error, match=re.escape(message)):
        ldls.odometry(sweeps)


def test_stamps_that_jump_ahead_are_warned_of(sweeps, trajectory):
    """Where places look alike, a lidar that moved in a gap passes for one that did not."""
    late = [(stamp + 300 * (number >= 2), points) for number, (stamp, points) in enumerate(sweeps[:4])]
    message = r"sweeps: 1 of 4 come over 1 s after .* the first 300\.100 s after 0\.100000 s, .*; mend the stamps"
    with pytest.warns(LdlsWarning, match=message) as caught:
        found = ldls.odometry(late)
    assert caught[0].filename == __file__
    np.testing.assert_allclose(found.poses, trajectory.poses[:4], atol=1e-9)
    # 2.2 - 1.2 is more than 1, and no gap
    ldls.odometry([(number + 0.2, points) for number, (_, points) in enumerate(sweeps[:3])])


def test_without_the_library_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "kiss_icp.config.config", None)
    with pytest.raises(ImportError, match=r"ldls\[odometry\]"):
        ldls.odometry([])


class Frames(list):
    """A source of so many frames, of which one is asked for at a time; one that is an error cannot be read."""

    path = "drive"

    @property
    def names(self):
        return tuple(map(str, range(len(self))))

    def __getitem__(self, index):
        frame = super().__getitem__(index)
        if isinstance(frame, Exception):
            raise frame
        return frame


def frames(stamps):
    return Frames(
        SimpleNamespace(name=str(k), stamp=stamp, times=None, points=street(k) - np.array([0.3 * k, 0, 0]))
        for k, stamp in enumerate(stamps)
    )


def test_a_source_without_stamps_has_ten_sweeps_a_second():
    assert odometry_of(frames([None] * 3)).stamps.tolist() == [0, 0.1, 0.2]
    way = odometry_of(frames([5.0, 5.2, 5.3]))
    assert way.stamps.tolist() == [5.0, 5.2, 5.3]
    np.testing.assert_allclose(way.poses[:, 0, 3], [0, 0.3, 0.6], atol=0.1)


def test_frames_of_a_source_are_not_kept():
    read = []

    class Source(Frames):
        def __getitem__(self, number):
            frame = frames([0.1 * number])[0]
            read.append(weakref.ref(frame.points))
            alive.append(sum(each() is not None for each in read))
            return frame

    alive = []
    assert len(odometry_of(Source(range(6)))) == 6
    assert max(alive) <= 2


@pytest.mark.parametrize("stamps", [[0.0, None], [None, 0.1]])
def test_stamps_are_those_of_all_frames_or_of_none(stamps):
    with pytest.raises(ldls.SourceError, match=r"^drive: frame 1 has (no|a) stamp, unlike those before it"):
        odometry_of(frames(stamps))


def test_faults_of_a_frame_name_the_source():
    with pytest.raises(ldls.InputError, match="^drive: sweeps: got 1"):
        odometry_of(frames([0.0]))


BROKEN = ldls.InputError("points: broken")


def spoilt(drive, faults):
    """The drive with frames that have no points, come too early, or cannot be read: 0, -1 or an error by number."""
    for number, fault in faults.items():
        if fault == 0:
            drive[number].points = np.zeros((0, 3))
        elif fault == -1:
            drive[number].stamp = drive[number - 1].stamp
        else:
            drive[number] = fault
    return drive


@pytest.mark.parametrize(
    ("faults", "lacks", "reason"),
    [
        pytest.param({4: BROKEN}, [4], "4: points: broken", id="one that cannot be read"),
        pytest.param({4: OSError("no disk")}, [4], "4: no disk", id="one whose file cannot be read"),
        pytest.param({4: 0}, [4], "4: of 0 points 0 are finite", id="one without points"),
        pytest.param({4: -1}, [4], "4: its stamp 0.3", id="one of the stamp before"),
        pytest.param({4: BROKEN, 5: 0}, [4, 5], "4: points: broken", id="two in a row"),
        pytest.param({3: 0, 5: BROKEN}, [3, 5], "3: of 0 points", id="two"),
        pytest.param({0: 0, 1: 0, 2: BROKEN}, [0, 1, 2], "0: of 0 points", id="three at the beginning"),
        pytest.param({5: 0, 6: 0, 7: BROKEN}, [5, 6, 7], "5: of 0 points", id="three at the end"),
        pytest.param({1: BROKEN}, [0, 1], "1: points: broken", id="the second, before motion is known"),
        pytest.param({2: BROKEN, 3: 0}, [0, 1, 2, 3], "2: points: broken", id="the third, before motion is known"),
    ],
)
def test_frames_that_say_nothing_are_left_out(faults, lacks, reason):
    drive = spoilt(frames([0.1 * k for k in range(8)]), faults)
    with pytest.warns(ldls.errors.LeftOutWarning) as caught:
        way = odometry_of(drive)
    (warning,) = caught
    listed = ", ".join(map(str, lacks))
    said = f"drive: {len(lacks)} of 8 frames ({listed}) are left out of the way of the lidar; {reason}"
    assert str(warning.message).startswith(said) and warning.filename == __file__
    left = [k for k in range(8) if k not in lacks]
    np.testing.assert_allclose(way.stamps, [0.1 * k for k in left])
    np.testing.assert_allclose(way.poses[:, 0, 3], 0.3 * (np.array(left) - left[0]), atol=0.1)


def test_past_more_than_two_frames_the_way_is_lost():
    drive = spoilt(frames([0.1 * k for k in range(8)]), {3: 0, 4: BROKEN, 5: 0})
    with pytest.raises(ldls.PoseError, match=r"^drive: 3 frames in a row \(3, 4, 5\) .*; frame 3: of 0 points 0 are"):
        odometry_of(drive)


@pytest.mark.parametrize(
    ("stamps", "frame"),
    [
        pytest.param([0.1 * (k % 5) for k in range(10)], "7", id="two drives"),
        pytest.param([100.0 if k == 4 else 0.1 * k for k in range(10)], "7", id="a stamp far ahead"),
    ],
)
def test_a_clock_that_stays_behind_is_another_drive(stamps, frame):
    with pytest.raises(ldls.PoseError, match=rf"^drive: frame {frame}: its stamp .* is not after that before it"):
        odometry_of(frames(stamps))


def test_where_no_frame_is_left_the_first_says_why():
    with pytest.raises(ldls.InputError, match="^drive: sweeps: got 0, expected 2 or more; frame 0: points: broken"):
        odometry_of(Frames([BROKEN] * 3))
