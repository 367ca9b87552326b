"""A simulated drive: through its source and the method, it scores as its frames do singly."""

import numpy as np
import pytest

import ldls
from ldls.datasets import open_source
from ldls.datasets.inspection import check_stamps, inspect
from ldls.evaluation import ClassSet, evaluate
from ldls.labeling import Labeling
from ldls.simulation import Drive, SensorErrors, drive_folder, drive_frame, write_drive

DRIVE = Drive(n_frames=3, seed=0, lidar="hdl-32e")


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
    assert not check_stamps(source.names, source.stamps) and not inspect(source, 2).findings


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


@pytest.mark.parametrize(
    "options", [pytest.param({"n_frames": 0}, id="no frames"), pytest.param({"camera": "ring"}, id="a ring")]
)
def test_drives_that_cannot_be_are_refused(options):
    with pytest.raises(ldls.ParameterError):
        Drive(**options)


def _stored_masks(drive, name):
    return ldls.read_masks(drive / f"masks_02/{name}.json")


def _scored(frame, masks):
    result = ldls.segment(frame.points, masks, frame.images[0].camera)
    return frame.name, Labeling.from_segmentation(result), frame.truth


def _mean_iou(pairs):
    scores = evaluate(pairs, classes=ClassSet.kitti()).semantic
    return np.mean([scores[name].iou for name in ("Car", "Pedestrian")])
