"""Simulated frames lie near the real ones in what the method depends on."""

import numpy as np
import pytest

import ldls
from ldls.evaluation.realism import (
    LabelledCloud,
    labelled_by_boxes,
    mask_overlap,
    points_by_elevation,
    points_by_range,
)
from ldls.io.labels import read_kitti_objects
from ldls.simulation import scene_frame
from ldls.stages import project

FRAMES = ("000000", "000001", "000002", "000003")


@pytest.fixture(scope="module")
def real(data_folder):
    training = data_folder / "kitti/training"
    return [
        labelled_by_boxes(
            read_kitti_objects(training / f"label_2/{name}.txt"),
            ldls.read_points(training / f"velodyne/{name}.bin"),
            ldls.read_masks(training / f"masks/{name}.json"),
            ldls.read_camera(training / f"calib/{name}.txt"),
        )
        for name in FRAMES
    ]


@pytest.fixture(scope="module")
def simulated():
    frames = [scene_frame(seed, kind=kind) for seed in range(4) for kind in ("street", "campus")]
    return [LabelledCloud(f.points, f.instances, f.categories, f.masks, f.camera) for f in frames]


def test_as_many_points_are_in_view(real, simulated):
    real_n, simulated_n = (
        np.mean([len(project(c.points, c.camera, image_size=c.masks.image_size)[0]) for c in clouds])
        for clouds in (real, simulated)
    )
    assert simulated_n == pytest.approx(real_n, rel=0.1)


def test_points_spread_over_the_scan_lines_alike(real, simulated):
    full = [c for c in real if len(c.points) > 100_000]  # one of the files holds the view alone
    real_share, share = (
        np.mean([points_by_elevation(c.points) for c in clouds], axis=0) for clouds in (full, simulated)
    )
    assert np.abs(share - real_share).max() < 0.045
    assert np.abs(share - real_share)[4:].max() < 0.03  # the lowest lines differ most


def test_a_car_has_as_many_points_at_its_range(real, simulated):
    bands = points_by_range(real, 3), points_by_range(simulated, 3)
    both = np.isfinite(bands[0]) & np.isfinite(bands[1])
    assert both.sum() >= 2
    ratio = bands[1][both] / bands[0][both]
    assert ((ratio > 1 / 3) & (ratio < 3)).all()


def test_masks_of_cars_overlap_their_points_alike(real, simulated):
    precision, recall = mask_overlap(simulated, 3)
    real_precision, real_recall = mask_overlap(real, 3)
    assert precision == pytest.approx(real_precision, abs=0.15)
    assert recall == pytest.approx(real_recall, abs=0.15)
