"""Every reader reads what is written; the suite is what it is by its seeds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ldls
from batch import runs
from ldls.errors import ParameterError
from ldls.evaluation import ClassSet
from ldls.io.labels.annotations import read_annotations
from ldls.simulation import (
    Drive,
    FrameOrder,
    SegmenterErrors,
    SensorErrors,
    SimulatedFrame,
    make_frames,
    make_rig,
    scene_frame,
    suite as make_whole_suite,
    suite_folder,
    suite_orders,
    write_drive,
    write_kitti,
)
from ldls.simulation.production import seeded_orders
from ldls.simulation.scene_object import CLASS_NAMES, CYCLIST
from ldls.stages import project


@pytest.fixture(scope="module")
def frame() -> SimulatedFrame:
    return scene_frame(21, kind="campus")


@pytest.fixture(scope="module")
def training(frame, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("scenes")
    write_kitti(folder, "000021", frame)
    return folder / "training"


def test_points_come_back(frame, training):
    np.testing.assert_array_equal(ldls.read_points(training / "velodyne/000021.bin"), frame.points)


def test_the_calibration_comes_back(frame, training):
    for number in range(4):
        camera = ldls.read_camera(training / "calib/000021.txt", camera=number)
        np.testing.assert_allclose(camera.projection, frame.images[0].camera.projection, atol=1e-9)
        np.testing.assert_allclose(camera.T_camera_lidar, frame.images[0].camera.T_camera_lidar, atol=1e-9)


def test_masks_come_back(frame, training):
    masks = ldls.read_masks(training / "masks/000021.json")
    np.testing.assert_array_equal(masks.to_array(), frame.images[0].masks.to_array())
    np.testing.assert_array_equal(masks.categories, frame.images[0].masks.categories)
    np.testing.assert_allclose(masks.scores, frame.images[0].masks.scores, atol=1e-4)


def test_the_image_comes_back(frame, training):
    with Image.open(training / "image_2/000021.png") as image:
        np.testing.assert_array_equal(np.asarray(image), frame.images[0].read())


def test_annotations_have_a_line_for_each_point(frame, training):
    truth = read_annotations(training / "annotations/000021.txt")
    np.testing.assert_array_equal(truth.instances, frame.truth.instances)
    names = np.array(truth.names)[truth.classes]
    assert not truth.ignored.any()
    categories = np.array([0, *(o.category for o in frame.objects)])[frame.truth.instances]
    assert set(names[frame.truth.instances == 0]) == {"background"}
    assert set(names[categories == 1]) == {"Pedestrian"}
    assert set(names[categories == 3]) == {"Car"}


def test_names_are_those_that_evaluation_knows():
    names = [CLASS_NAMES[category] for category in (1, 3, 8, 6, 64, CYCLIST)]
    assert names == ["Pedestrian", "Car", "Truck", "bus", "potted plant", "Cyclist"]
    assert all(ClassSet.kitti().knows(name) for name in names)


def test_boxes_hold_the_points_of_their_objects(frame, training):
    rows = [line.split() for line in (training / "label_2/000021.txt").read_text().splitlines()]
    assert {len(row) for row in rows} == {15}
    assert {row[0] for row in rows} <= {"Car", "Pedestrian", "Truck", "Cyclist", "Misc"}
    boxes = np.array([row[1:] for row in rows], float)
    transform = frame.images[0].camera.T_camera_lidar
    points = frame.points[:, :3].astype(float) @ transform[:3, :3].T + transform[:3, 3]
    checked = 0
    for m, thing in enumerate(frame.objects, start=1):
        mine = points[frame.truth.instances == m]
        bottom = transform[:3, :3] @ (np.array(thing.centre_m) - (0, 0, thing.height_m / 2)) + transform[:3, 3]
        near = np.abs(boxes[:, 10:13] - bottom).max(axis=1) < 0.01
        if len(mine) < 20 or not near.any():
            continue
        height, width, length, x, y, z, turn = boxes[near][0, 7:14]
        c, s = np.cos(turn), np.sin(turn)
        local = (mine - (x, y, z)) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        inside = (np.abs(local[:, 0]) < length / 2 + 0.15) & (np.abs(local[:, 2]) < width / 2 + 0.15)
        inside &= (local[:, 1] < 0.15) & (local[:, 1] > -height - 0.15)
        assert inside.mean() > 0.97
        checked += 1
    assert checked >= 5


def test_image_boxes_lie_in_the_image_and_around_the_pixels(training):
    rows = np.array([line.split()[1:] for line in (training / "label_2/000021.txt").read_text().splitlines()], float)
    left, top, right, bottom = rows[:, 3:7].T
    assert ((left >= 0) & (left <= right) & (right <= 1241) & (top >= 0) & (top <= bottom) & (bottom <= 374)).all()
    assert ((rows[:, 0] >= 0) & (rows[:, 0] <= 1) & np.isin(rows[:, 1], (0, 1, 2))).all()


def test_the_method_runs_on_the_files(training):
    result = ldls.segment(
        ldls.read_points(training / "velodyne/000021.bin"),
        ldls.read_masks(training / "masks/000021.json"),
        ldls.read_camera(training / "calib/000021.txt"),
    )
    assert (result.labels > 0).sum() > 200


def quarter(mounted):
    """A camera with a sixteenth of the pixels, to be drawn sooner."""
    model, (u, v) = mounted.model, mounted.model.center_px
    smaller = replace(
        model,
        width=model.width // 4,
        height=model.height // 4,
        focal_px=model.focal_px / 4,
        center_px=(u / 4, v / 4),
    )
    return replace(mounted, model=smaller)


def test_a_ring_has_a_folder_for_each_camera(tmp_path):
    ring = make_rig(lidar="hdl-32e", camera="ring")
    assert {(mounted.model.height, mounted.model.width) for mounted in ring.cameras} == {(900, 1600)}
    assert [mounted.model.focal_px for mounted in ring.cameras] == [809.2 if k == 3 else 1266.4 for k in range(6)]
    frame = scene_frame(0, rig=replace(ring, cameras=tuple(map(quarter, ring.cameras))))
    write_kitti(tmp_path, "000000", frame)
    in_view = [project(frame.points, image.camera, image_size=(225, 400))[0] for image in frame.images]
    assert len(np.unique(np.concatenate(in_view))) > 0.5 * len(frame.points)
    for k in range(1, 6):
        camera = ldls.read_camera(tmp_path / f"training/calib_ring_{k}/000000.txt")
        assert camera.projection[0, 0] == pytest.approx((809.2 if k == 3 else 1266.4) / 4)
        assert (tmp_path / f"training/image_ring_{k}/000000.png").stat().st_size > 10_000
        assert ldls.read_masks(tmp_path / f"training/masks_ring_{k}/000000.json").image_size == (225, 400)


def orders(count):
    errors = {"segmenter": SegmenterErrors(), "sensors": SensorErrors()}
    return [FrameOrder(name=f"{n:06d}", seed=n, lidar="vlp-16", camera="robot", **errors) for n in range(count)]


def test_whole_frames_are_kept_and_broken_ones_made_anew(tmp_path):
    first = list(make_frames(tmp_path, orders(2), processes=1))
    assert [s.name for s in first] == ["000000", "000001"]
    (tmp_path / "training/annotations/000001.txt").unlink()
    assert [order.is_whole(tmp_path) for order in orders(2)] == [True, False]
    again = list(make_frames(tmp_path, orders(2), processes=1))
    assert again[0] is None and again[1] == first[1]


def test_two_processes_write_what_one_writes(tmp_path):
    alone, together = tmp_path / "one", tmp_path / "two"
    list(make_frames(alone, orders(2), processes=1))
    list(make_frames(together, orders(2), processes=2))
    files = sorted(p.relative_to(alone) for p in alone.rglob("*") if p.is_file())
    assert len(files) == 14
    assert all((alone / f).read_bytes() == (together / f).read_bytes() for f in files)


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        pytest.param({"seed": 7}, "line 3: got '\"seed\": 1', expected '\"seed\": 7'", id="seed"),
        pytest.param({"kind": "campus"}, '"kind": "campus"', id="scene"),
        pytest.param({"lidar": "hdl-32e"}, '"lidar": "hdl-32e"', id="lidar"),
        pytest.param({"camera": "kitti"}, '"camera": "kitti"', id="rig"),
        pytest.param({"segmenter": SegmenterErrors.none()}, '"mask_cells": 0', id="errors"),
    ],
)
def test_frames_of_another_kind_are_neither_kept_nor_added_to(tmp_path, changed, named):
    list(make_frames(tmp_path, orders(2), processes=1))
    before = runs.contents(tmp_path)
    others = [replace(order, **changed) if order.seed else order for order in orders(3)]
    with pytest.raises(ParameterError, match=rf"holds frames that are made of something else: 000001\.json: .*{named}"):
        next(make_frames(tmp_path, others, processes=1))
    assert runs.contents(tmp_path) == before
    # what was not finished binds nobody
    (tmp_path / "training/annotations/000001.txt").unlink()
    assert [order.is_whole(tmp_path) for order in others] == [True, False, False]


def test_settings_of_numpy_are_written_as_those_of_python(tmp_path):
    errors = SegmenterErrors(missed=np.float32(0.5)), SensorErrors(delay_s=np.float32(0.25))
    (order,) = seeded_orders(np.arange(1), lidar="vlp-16", segmenter=errors[0], sensors=errors[1])
    order.make(tmp_path / "frames")
    assert order.is_whole(tmp_path / "frames")
    drives = [Drive(n_frames=n, seed=seed, lidar="vlp-16") for n, seed in ((np.int64(1), np.int64(2)), (1, 2))]
    for drive in drives:
        # the second goes on with the frame of the first
        assert len([*write_drive(tmp_path / "drive", drive)]) == 1


def test_no_process_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="processes"):
        list(make_frames(tmp_path, orders(1), processes=0))


def test_the_suite_is_fixed():
    validation, tuning = suite_orders("validation"), suite_orders("tuning")
    assert [o.seed for o in validation] == list(range(1000, 1200))
    assert [o.seed for o in tuning] == list(range(2000, 2020))
    assert {o.kind for o in validation[:100]} == {"street", "campus"}
    assert {(o.lidar, o.camera) for o in validation + tuning} == {("hdl-64e", "kitti")}
    with pytest.raises(ParameterError, match="validation, tuning"):
        suite_orders("test")


def test_the_suite_is_kept_in_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("LDLS_CACHE", str(tmp_path))
    folder = suite_folder("tuning")
    assert folder.is_relative_to(tmp_path) and "suite-v2" in folder.parts
    (folder / "training/annotations").mkdir(parents=True)
    for order in suite_orders("tuning"):
        (folder / f"training/annotations/{order.name}.txt").touch()
    assert make_whole_suite("tuning") == folder
    assert not (folder / "training/velodyne").exists()
