"""Cyclists: one object in truth, in which a segmenter finds a person and a bicycle."""

from dataclasses import replace

import numpy as np
import pytest

from ldls.camera.rigid import transformed
from ldls.evaluation import ClassSet
from ldls.io.labels import read_kitti_objects
from ldls.simulation import (
    PixelTruth,
    SegmenterErrors,
    SimulatedFrame,
    make_rig,
    make_scene,
    segmented,
    true_masks,
    write_kitti,
)
from ldls.simulation.ground import Ground, Strip
from ldls.simulation.layouts import pavement
from ldls.simulation.plan import Plan
from ldls.simulation.scene_object import BICYCLE, CYCLIST, PERSON
from ldls.simulation.scenes import Scene, build
from ldls.simulation.shapes import figures, vehicles
from ldls.simulation.shapes.shape import Material
from ldls.simulation.simulated_frame import take_frame

NONE = SegmenterErrors.none()
SPEED_M_S = 4.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A cyclist, seen from the side, on a plain 8 m ahead."""
    plain = Ground((Strip(-60, 60, 0.0, (0.3, 0.3, 0.3), Material.ASPHALT),), (0.0, 0.0), 0.0, 0.0)
    plan, rng = Plan(plain), np.random.default_rng(4)
    bicycle = vehicles.bicycle(rng)
    parts = {PERSON: figures.rider(bicycle, rng), BICYCLE: bicycle}
    assert plan.put(CYCLIST, parts, 8, 0, yaw=np.pi / 2, speed_m_s=SPEED_M_S)
    return build(plan)


@pytest.fixture(scope="module")
def frame(scene) -> SimulatedFrame:
    return take_frame(
        scene, scene, make_rig(), name="000004", stamps=(0, 0), sweep_noise=(4,), mask_seed=4, drift=np.eye(4),
        segmenter=NONE,
    )  # fmt: skip


def test_a_cyclist_is_one_object_that_rides_along_its_heading(scene):
    (cyclist,) = scene.objects
    assert cyclist.category == CYCLIST
    assert cyclist.velocity_m_s == pytest.approx((0.0, SPEED_M_S))
    assert 1.5 < cyclist.length_m < 1.9 and 0.5 < cyclist.width_m < 0.75 and 1.55 < cyclist.height_m < 2.0


def test_person_and_bicycle_move_as_one(scene):
    later = scene.after(0.5)
    shift = later.shape.vertices_m - scene.shape.vertices_m
    faces = scene.shape.faces[scene.face_objects == 1]
    np.testing.assert_allclose(shift[faces.ravel()], np.tile([0, 2.0, 0], (faces.size, 1)), atol=1e-9)


def test_truth_has_one_cyclist(frame):
    points = np.array(frame.truth.names)[frame.truth.classes] == "Cyclist"
    assert points.sum() > 200
    np.testing.assert_array_equal(frame.truth.instances, points)


def test_no_score_counts_a_cyclist_by_default(frame):
    mapped = ClassSet.kitti().map(frame.truth, truth=True)
    np.testing.assert_array_equal(mapped.ignored, frame.truth.instances == 1)


def test_a_segmenter_finds_a_person_and_a_bicycle(frame):
    masks, (image,) = frame.images[0].masks, frame.images
    assert masks.categories.tolist() == true_masks(image.pixels).categories.tolist() == [PERSON, BICYCLE]
    body, bicycle = masks.to_array()
    np.testing.assert_array_equal(body ^ bicycle, image.pixels.instances == 1)
    rows = [np.flatnonzero(mask.any(axis=1)) for mask in (body, bicycle)]
    assert rows[0].min() < rows[1].min() < rows[0].max() < rows[1].max()


def test_the_two_masks_err_each_in_its_own_way():
    v, u = np.mgrid[:100, :200]
    discs = [(v - 50) ** 2 + (u - column) ** 2 <= 30**2 for column in (50, 150)]
    pixels = PixelTruth(sum(disc.astype(np.int32) for disc in discs), np.select(discs, (PERSON, BICYCLE)), np.ones(1))
    areas = {mask.category: mask.area for mask in segmented(pixels, errors=replace(NONE, bleed_px=3.0))}
    assert areas[PERSON] != areas[BICYCLE]


def test_label_2_has_one_box_around_person_and_bicycle(frame, tmp_path):
    write_kitti(tmp_path, "000004", frame)
    (box,) = read_kitti_objects(tmp_path / "training/label_2/000004.txt")
    assert box.type == "Cyclist"
    placed = transformed(frame.points, frame.images[0].camera.T_camera_lidar)
    assert box.contains(placed)[frame.truth.instances == 1].mean() > 0.95


def test_the_rider_sits_on_the_saddle_with_both_hands_at_the_handlebar(scene):
    body, bicycle = (
        scene.shape.vertices_m[np.unique(scene.shape.faces[scene.face_categories == c])] for c in (PERSON, BICYCLE)
    )
    assert 0.02 < body[:, 2].min() < 0.2
    assert body[:, 2].max() > bicycle[:, 2].max() + 0.5
    grips = bicycle[bicycle[:, 2] > bicycle[:, 2].max() - 0.03]
    for grip in (grips[grips[:, 0].argmin()], grips[grips[:, 0].argmax()]):
        assert np.linalg.norm(body - grip, axis=1).min() < 0.08


@pytest.mark.parametrize("seed", [11, 17])
def test_cyclists_come_after_all_else_and_change_none_of_it(seed, monkeypatch):
    objects = make_scene(seed).objects
    monkeypatch.setattr(pavement, "ONE_MORE_CYCLIST", 0.0)
    others = make_scene(seed).objects
    cyclists = objects[len(others) :]
    assert objects[: len(others)] == others
    assert cyclists and all(thing.category == CYCLIST for thing in cyclists)
    assert all(3 <= np.hypot(*thing.velocity_m_s) <= 6 for thing in cyclists)
