"""The simulated robot: its lens, its bag, and its sweeps through the source to labels and back."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
pytest.importorskip("embreex")

import ldls
from ldls.datasets import RosBag
from ldls.errors import CalibrationError, ParameterError, PoseError
from ldls.io.labelled_bag import LabelledBag
from ldls.io.labels.annotations import read_annotations
from ldls.simulation import SegmenterErrors, robot_drive, write_robot_drive
from ldls.simulation.drives import ROBOT
from ldls.simulation.rigs import CameraModel, distorted, undistorted
from ldls.simulation.scene_object import KITTI_TYPES
from ldls.stages import project

KINDS = {"rosbag1": "drive.bag", "rosbag2": "drive", "mcap": "drive"}
FRAMES, SEED = 4, 0
MODEL = ROBOT.cameras[0].model


@pytest.fixture(scope="module")
def simulated():
    return list(robot_drive(FRAMES, seed=SEED, segmenter=SegmenterErrors.none()))


@pytest.fixture(scope="module", params=KINDS)
def drive_folder(request, simulated, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    kind = request.param
    options = {"seed": SEED, "segmenter": SegmenterErrors.none()}

    def simulated_once(frames, **asked):
        assert {key: asked[key] for key in options} == options
        return iter(simulated[:frames])

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys.modules[write_robot_drive.__module__], "robot_drive", simulated_once)
        path = write_robot_drive(folder, kind, frames=FRAMES, **options, compressed=kind == "mcap")
    assert path == folder / KINDS[kind]
    return folder


def ious(labels, truth):
    """IoU of each object that has 10 true points or more in view, with the label that overlaps it most."""
    seen = labels >= 0
    found = []
    for number in np.unique(truth[seen & (truth > 0)]):
        mine = truth[seen] == number
        if mine.sum() >= 10:
            others = [labels[seen] == label for label in np.unique(labels[seen & (labels > 0)])]
            found.append(max(((mine & other).sum() / (mine | other).sum() for other in others), default=0.0))
    return found


def test_the_rays_of_a_lens_come_back_to_their_pixels():
    points = 12 * MODEL.directions()
    camera = ldls.Camera(projection=MODEL.projection(), distortion=MODEL.distortion)
    in_view, pixels = project(points, camera, image_size=(480, 640))
    assert len(in_view) > 0.99 * len(points)
    v, u = np.divmod(in_view, 640)
    np.testing.assert_allclose(pixels, np.column_stack([u, v]), atol=1e-6)


@pytest.mark.parametrize(
    "lens",
    [
        pytest.param(
            ldls.Distortion("rational_polynomial", (0.1, -0.05, 1e-3, 2e-3, 0.01, 0.2, 0.1, 0.02)), id="rational"
        ),
        pytest.param(ldls.Distortion(), id="none"),
    ],
)
def test_undistorting_undoes_distorting(lens):
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 2))
    np.testing.assert_allclose(undistorted(distorted(points, lens), lens), points, atol=1e-8)


@pytest.mark.parametrize(
    ("lens", "match"),
    [
        pytest.param(ldls.Distortion("plumb_bob", (-3.0, 0, 0, 0)), "folds back", id="folds back"),
        pytest.param(ldls.Distortion("equidistant", (0.1, 0, 0, 0)), "not simulated", id="fisheye"),
    ],
)
def test_lenses_that_cannot_be_simulated(lens, match):
    with pytest.raises(CalibrationError, match=match):
        CameraModel(64, 48, 40.0, (31.5, 23.5), lens).directions()


def test_the_bag_holds_what_was_simulated(drive_folder, simulated):
    bag = RosBag(next(drive_folder.glob("drive*")))
    assert len(bag) == FRAMES
    np.testing.assert_allclose(bag.offsets_s, 0.012)
    for number, (frame, made) in enumerate(zip(bag, simulated, strict=True)):
        np.testing.assert_array_equal(frame.points[:, :3], made.points[:, :3])
        np.testing.assert_array_equal(bag.cloud(number).fields["ring"], 15 - made.rings)
        assert "time" not in bag.cloud(number).fields.dtype.names, "all points are of one instant"
        (image,) = frame.images
        np.testing.assert_array_equal(image.read(), made.images[0].read())
        assert image.camera.distortion == made.images[0].camera.distortion == MODEL.distortion
        np.testing.assert_allclose(image.camera.T_camera_lidar, ROBOT.cameras[0].T_camera_lidar(), atol=1e-12)
        masks = ldls.read_masks(drive_folder / f"masks/{frame.name}.json")
        np.testing.assert_array_equal(masks.to_array(), made.images[0].masks.to_array())
        truth = read_annotations(drive_folder / f"annotations/{frame.name}.txt")
        np.testing.assert_array_equal(truth.instances, made.truth.instances)


def test_a_bag_whose_world_is_named_has_the_poses_that_were_simulated(drive_folder, simulated):
    bag = next(drive_folder.glob("drive*"))
    assert RosBag(bag)[1].pose is None
    made = np.array([frame.pose for frame in simulated])
    assert np.ptp(made[:, 0, 3]) == pytest.approx(0.36)
    # odom is on the ground
    made[:, 2, 3] = ROBOT.height_m
    np.testing.assert_allclose([frame.pose for frame in RosBag(bag, world="odom")], made, atol=1e-6)
    with pytest.raises(PoseError, match="transforms: nothing connects .* the world 'map'; found od"):
        RosBag(bag, world="map")


def test_the_first_frame_of_a_drive_has_the_true_classes():
    (frame,) = robot_drive(1)
    (image,) = frame.images
    result = ldls.segment(frame.points, image.masks, image.camera)
    true = np.array(frame.truth.names)[frame.truth.classes]
    things = [thing for thing in result.objects if thing.n_points > 0]
    assert len(things) > 10
    for thing in things:
        names, counts = np.unique(true[result.labels == thing.label], return_counts=True)
        assert names[counts.argmax()] == KITTI_TYPES.get(thing.category, thing.name)


def test_only_the_names_of_a_drive_s_masks_are_without_errors():
    (usual,), (drive,) = (list(robot_drive(1, segmenter=each)) for each in (SegmenterErrors(), None))
    named, right = usual.images[0].masks, drive.images[0].masks
    assert sorted(mask.area for mask in named) == sorted(mask.area for mask in right)
    assert sorted(mask.name for mask in named) != sorted(mask.name for mask in right)


def test_from_bag_to_labelled_bag_and_back(drive_folder, simulated, tmp_path):
    source = RosBag(next(drive_folder.glob("drive*")))
    kind = next(k for k in KINDS if drive_folder.name.startswith(k))
    out = tmp_path / KINDS[kind]
    results = []
    with LabelledBag(out, kind) as bag:
        bag.copy(source.path)
        for number, frame in enumerate(source):
            masks = ldls.read_masks(drive_folder / f"masks/{frame.name}.json")
            results.append(ldls.segment(frame.points, masks, frame.images[0].camera))
            bag.write(results[-1], source.header(number))
    labelled = RosBag(out, points_topic="/points_labelled")
    by_bag, direct = [], []
    for number, (result, made) in enumerate(zip(results, simulated, strict=True)):
        (image,) = made.images
        fields = labelled.cloud(number).fields
        np.testing.assert_array_equal(fields["instance_id"], np.maximum(result.labels, 0))
        np.testing.assert_array_equal(fields["class_id"], result.categories)
        assert labelled.header(number) == source.header(number)
        labels = np.where(result.labels < 0, -1, fields["instance_id"].astype(int))
        by_bag += ious(labels, made.truth.instances)
        direct += ious(ldls.segment(made.points, image.masks, image.camera).labels, made.truth.instances)
    assert len(by_bag) >= 30
    assert np.mean(by_bag) == pytest.approx(np.mean(direct), abs=0.01)
    assert np.mean(by_bag) > 0.8


def test_without_its_distortion_the_lens_costs_accuracy(simulated):
    true, pinhole = [], []
    for made in simulated:
        (image,) = made.images
        for scores, lens in ((true, MODEL.distortion), (pinhole, ldls.Distortion())):
            camera = dataclasses.replace(image.camera, distortion=lens)
            labels = ldls.segment(made.points, image.masks, camera).labels
            scores += ious(labels, made.truth.instances)
    assert np.mean(true) > np.mean(pinhole) + 0.05


def test_the_robot_drives_and_objects_move(simulated):
    assert [frame.stamp for frame in simulated] == pytest.approx([0, 0.1, 0.2, 0.3])
    first, last = simulated[0].objects, simulated[3].objects
    moved = [after.centre_m[0] - before.centre_m[0] for before, after in zip(first, last, strict=True)]
    assert moved == pytest.approx([0.3 * (o.velocity_m_s[0] - 1.2) for o in first])
    assert not np.array_equal(simulated[0].images[0].read(), simulated[3].images[0].read())
    again = next(robot_drive(1, seed=SEED, segmenter=SegmenterErrors.none()))
    np.testing.assert_array_equal(again.points, simulated[0].points)


def test_bags_are_refused_before_anything_is_made(tmp_path):
    with pytest.raises(ParameterError, match="kind"):
        write_robot_drive(tmp_path / "out", "rosbag3")
    assert not (tmp_path / "out").exists()
    with pytest.raises(ParameterError, match="frames: got 0"):
        next(robot_drive(0))
