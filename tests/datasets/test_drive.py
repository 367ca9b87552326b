"""A simulated drive: through its source and the method, it scores as its frames do singly."""

from dataclasses import replace

import numpy as np
import pytest

import ldls
from batch import runs
from ldls.datasets import open_source
from ldls.datasets.inspection import check_stamps, inspect
from ldls.evaluation import ClassSet, evaluate
from ldls.labeling import Labeling
from ldls.simulation import Drive, SegmenterErrors, SensorErrors, drive_folder, drive_frame, write_drive
from ldls.simulation.drives import drive_poses

DRIVE = Drive(n_frames=3, seed=0, lidar="hdl-32e")
TURNS = Drive(n_frames=12, seed=2, lidar="vlp-16", camera="robot", turn_deg_s=20.0)
"""5.5 m and 22 degrees to the left."""


@pytest.fixture(scope="module")
def drive_path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drives")
    assert all(summary is not None for summary in write_drive(folder, DRIVE))
    assert list(write_drive(folder, DRIVE)) == [None] * DRIVE.n_frames, "what is there is kept"
    return drive_folder(folder, DRIVE)


def test_the_source_gives_back_what_was_simulated(drive_path):
    source = open_source(drive_path)
    assert source.kind == "kitti-raw" and len(source) == 3
    assert np.diff(source.stamps) == pytest.approx(0.1, abs=1e-6)
    simulated = drive_frame(DRIVE, 2)
    frame = source[2]
    assert np.array_equal(frame.points, simulated.points)
    assert np.array_equal(frame.images[0].read(), simulated.images[0].read())
    assert frame.images[0].camera.projection == pytest.approx(simulated.images[0].camera.projection)
    assert frame.images[0].camera.T_camera_lidar == pytest.approx(simulated.images[0].camera.T_camera_lidar, abs=1e-9)
    assert frame.stamp - frame.images[0].stamp == pytest.approx(DRIVE.sensors.delay_s, abs=1e-6)
    np.testing.assert_allclose(frame.pose, simulated.pose, atol=1e-6)
    assert frame.pose[0, 3] == pytest.approx(0.2 * DRIVE.speed_m_s)
    assert not check_stamps(source.names, source.stamps) and not inspect(source, 2).findings


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        pytest.param({"lidar": "vlp-16"}, 'drive.json: .* expected \'"lidar": "vlp-16"\'', id="another lidar"),
        pytest.param({"segmenter": SegmenterErrors.none()}, '"mask_cells": 0', id="other masks"),
        pytest.param({"n_frames": 2}, "timestamps.txt: line 3: .* expected no more lines", id="fewer frames"),
        pytest.param({"n_frames": 100}, 'expected \'"speed_m_s": 4.0', id="so many frames that it is slower"),
    ],
)
def test_another_drive_does_not_go_on_where_one_lies(drive_path, changed, named):
    before = runs.contents(drive_path.parent)
    with pytest.raises(ldls.ParameterError, match=f"holds another drive, or more frames: .*{named}"):
        next(write_drive(drive_path.parents[1], replace(DRIVE, **changed)))
    assert runs.contents(drive_path.parent) == before


def test_a_drive_goes_on_with_more_frames_that_leave_the_first_as_they_are(tmp_path):
    short = replace(TURNS, n_frames=2)
    assert None not in list(write_drive(tmp_path, short))
    before = runs.contents(tmp_path)
    longer = list(write_drive(tmp_path, replace(TURNS, n_frames=3)))
    assert longer.count(None) == 2 and len(longer) == 3
    after = runs.contents(tmp_path)
    assert all(after[name].startswith(content) for name, content in before.items())
    assert len(open_source(drive_folder(tmp_path, short))) == 3


def test_a_drive_scores_as_its_frames_do_singly(drive_path):
    source = open_source(drive_path)
    through = [_scored(source[k], _stored_masks(drive_path, source.names[k])) for k in range(len(source))]
    singly = []
    for k, frame in enumerate(source):
        simulated = drive_frame(DRIVE, k)
        result = ldls.segment(simulated.points, simulated.images[0].masks, simulated.images[0].camera)
        singly.append((frame.name, Labeling.from_segmentation(result), frame.truth))
    mean_through, mean_singly = _mean_iou(through), _mean_iou(singly)
    assert mean_through == pytest.approx(mean_singly, abs=1e-3)
    assert mean_through > 0.5


def test_objects_move_while_the_rig_does_and_none_is_run_over():
    drive = Drive(n_frames=4, seed=3, lidar="vlp-16", camera="robot", sensors=SensorErrors.none())
    first, last = drive_frame(drive, 0), drive_frame(drive, 3)
    moving = np.array([thing.velocity_m_s for thing in first.objects])
    moved = np.array([b.centre_m for b in last.objects]) - [a.centre_m for a in first.objects]
    assert np.abs(moving).max() > 1
    assert moved[:, :2] == pytest.approx(0.3 * (moving - [drive.speed_m_s, 0]))
    assert np.abs(moved[:, 2]).max() < 0.3, "objects keep to the ground"
    assert np.linalg.norm(last.points[:, :2], axis=1).min() > 0.5


def test_a_drive_that_turns_follows_an_arc():
    poses = drive_poses(TURNS)
    yaw = np.radians(20 * 0.1 * np.arange(12))
    radius = TURNS.speed_m_s / np.radians(20)
    np.testing.assert_allclose(poses[:, 0, 3], radius * np.sin(yaw), atol=1e-9)
    np.testing.assert_allclose(poses[:, 1, 3], radius * (1 - np.cos(yaw)), atol=1e-9)
    np.testing.assert_allclose(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]), yaw, atol=1e-9)
    assert 0 < np.ptp(poses[:, 2, 3]) < 0.3, "the rig keeps to the ground"


def test_poses_of_a_drive_that_turns_are_read_as_they_are(tmp_path):
    """To a tenth of a millimetre, through latitude and longitude."""
    made = write_drive(tmp_path, TURNS)
    next(made)  # one frame, for the poses are written first
    folder = drive_folder(tmp_path, TURNS)
    trajectory = ldls.read_poses(folder / "oxts")
    np.testing.assert_allclose(trajectory.poses, drive_poses(TURNS), atol=1e-4)
    (source,) = (open_source(folder),)
    assert source[0].stamp == trajectory.stamps[0]


@pytest.mark.parametrize("turn_deg_s", [-20.0, 0.0, 20.0])
def test_what_stands_still_stays_where_it_is_in_the_world(turn_deg_s):
    drive = replace(TURNS, turn_deg_s=turn_deg_s)
    first, last = drive_frame(drive, 0), drive_frame(drive, 11)
    np.testing.assert_array_equal(first.pose, np.eye(4))
    n_seen = 0
    for number, (was, thing) in enumerate(zip(first.objects, last.objects, strict=True), start=1):
        assert thing.yaw - was.yaw == pytest.approx(-np.radians(1.1 * turn_deg_s))
        if was.velocity_m_s != (0, 0):
            continue
        assert (last.pose @ [*thing.centre_m, 1])[:3] == pytest.approx(was.centre_m, abs=1e-9)
        points = last.points[last.truth.instances == number, :3] @ last.pose[:3, :3].T + last.pose[:3, 3]
        c, s = np.cos(was.yaw), np.sin(was.yaw)
        within = np.abs((points - was.centre_m) @ [[c, -s, 0], [s, c, 0], [0, 0, 1]])
        n_seen += len(points)
        # the range's noise is 15 mm
        assert np.all(within < np.array([was.length_m, was.width_m, was.height_m]) / 2 + 0.1)
    assert n_seen > 200


def test_what_moves_goes_its_own_way_in_the_world_while_the_rig_turns():
    first, last = drive_frame(TURNS, 0), drive_frame(TURNS, 11)
    moving = [pair for pair in zip(first.objects, last.objects, strict=True) if np.hypot(*pair[0].velocity_m_s) > 1]
    assert moving
    for was, thing in moving:
        way = (last.pose @ [*thing.centre_m, 1])[:2] - was.centre_m[:2]
        assert way == pytest.approx(np.multiply(1.1, was.velocity_m_s), abs=1e-9)


def test_a_rig_that_leaves_the_road_drives_through_nothing():
    drive = Drive(n_frames=60, seed=2, lidar="vlp-16", camera="robot", turn_deg_s=12.0)
    for number in (25, 40, 59):
        # the ground is farther away
        assert np.linalg.norm(drive_frame(drive, number).points[:, :3], axis=1).min() > 1.2


@pytest.mark.parametrize(
    "options",
    [
        pytest.param({"n_frames": 0}, id="no frames"),
        pytest.param({"camera": "ring"}, id="a ring"),
        pytest.param({"turn_deg_s": 91.0}, id="too fast a turn"),
        pytest.param({"turn_deg_s": float("nan")}, id="no turn"),
    ],
)
def test_drives_that_cannot_be_are_refused(options):
    with pytest.raises(ldls.ParameterError):
        Drive(**options)


@pytest.mark.parametrize("number", [3, -1, 1.0, True, "0", None])
def test_frames_that_a_drive_does_not_have_are_refused(number):
    with pytest.raises(ldls.ParameterError, match="number: got .*, expected"):
        drive_frame(Drive(n_frames=3, lidar="vlp-16"), number)


def _stored_masks(drive, name):
    return ldls.read_masks(drive / f"masks_02/{name}.json")


def _scored(frame, masks):
    result = ldls.segment(frame.points, masks, frame.images[0].camera)
    return frame.name, Labeling.from_segmentation(result), frame.truth


def _mean_iou(pairs):
    scores = evaluate(pairs, classes=ClassSet.kitti()).semantic
    return np.mean([scores[name].iou for name in ("Car", "Pedestrian")])
