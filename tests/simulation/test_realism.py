"""Simulated frames lie near the real ones in three measures that the method depends on."""

from dataclasses import replace

import numpy as np
import pytest

from ldls.camera.rigid import transformed
from ldls.datasets import KittiObjectSource
from ldls.io.labels import read_kitti_objects
from ldls.labeling import Labeling
from ldls.simulation import scene_frame
from ldls.stages import direct_labels, project

FRAMES = ("000000", "000001", "000002", "000003")
ELEVATIONS_DEG = np.arange(-24.0, 2.1, 2.0)
RANGES_M = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0)
CLASSES = {"Car": "Car", "Pedestrian": "Pedestrian", "Person_sitting": "Pedestrian"}
CAR = 3
GROUND_M = 0.1


@pytest.fixture(scope="module")
def real(data_folder):
    training = data_folder / "kitti/training"
    source = KittiObjectSource(training, masks="masks")
    frames = [source[source.names.index(name)] for name in FRAMES]
    return [labelled_by_boxes(frame, read_kitti_objects(training / f"label_2/{frame.name}.txt")) for frame in frames]


@pytest.fixture(scope="module")
def simulated():
    return [scene_frame(seed, kind=kind) for seed in range(4) for kind in ("street", "campus")]


def labelled_by_boxes(frame, objects):
    """The frame with KITTI's boxes of cars and people as truth; their lowest 0.1 m is left out, as ground is there."""
    placed = transformed(frame.points, frame.images[0].camera.T_camera_lidar)
    instances = np.zeros(len(frame.points), np.int32)
    boxes = [one for one in objects if one.type in CLASSES]
    for number, box in enumerate(boxes, start=1):
        instances[box.contains(placed) & (box.in_box_frame(placed)[:, 1] >= GROUND_M)] = number
    return replace(frame, truth=Labeling.from_instance_labels(instances, [CLASSES[box.type] for box in boxes]))


def in_view(frame):
    (image,) = frame.images
    return project(frame.points, image.camera, image_size=image.masks.image_size)


def points_by_elevation(points):
    """Share of the points in each band of 2 degrees of elevation, from -24 to 2."""
    xyz = np.asarray(points, np.float64)[:, :3]
    rise = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    return np.histogram(rise, ELEVATIONS_DEG)[0] / len(xyz)


def points_of_a_car_by_range(frames):
    """Median points of a car in each band of RANGES_M; NaN where there is none."""
    distances, counts = [], []
    for frame in frames:
        cars = np.array(frame.truth.names)[frame.truth.classes] == "Car"
        for instance in np.unique(frame.truth.instances[cars]):
            mine = frame.truth.instances == instance
            distances.append(np.median(np.linalg.norm(frame.points[mine, :2], axis=1)))
            counts.append(mine.sum())
    bands = np.digitize(distances, RANGES_M)
    chosen = [np.array(counts)[bands == k] for k in range(1, len(RANGES_M))]
    return np.array([np.median(c) if len(c) else np.nan for c in chosen])


def overlap_of_cars(frames):
    """Precision and recall of direct projection for cars, over all points in view."""
    hits = claimed = true = 0
    for frame in frames:
        rows, pixels = in_view(frame)
        masks = frame.images[0].masks
        labels = np.append(0, masks.categories)[direct_labels(pixels, masks)] == CAR
        truth = np.array(frame.truth.names)[frame.truth.classes[rows]] == "Car"
        hits, claimed, true = hits + (labels & truth).sum(), claimed + labels.sum(), true + truth.sum()
    return hits / claimed, hits / true


def test_as_many_points_are_in_view(real, simulated):
    real_n, simulated_n = (np.mean([len(in_view(frame)[0]) for frame in frames]) for frames in (real, simulated))
    assert simulated_n == pytest.approx(real_n, rel=0.1)


def test_points_spread_over_the_scan_lines_alike(real, simulated):
    full = [frame for frame in real if len(frame.points) > 100_000]  # one of the files holds the view alone
    real_share, share = (
        np.mean([points_by_elevation(frame.points) for frame in frames], axis=0) for frames in (full, simulated)
    )
    assert np.abs(share - real_share).max() < 0.045
    assert np.abs(share - real_share)[4:].max() < 0.03  # the lowest lines differ most


def test_a_car_has_as_many_points_at_its_range(real, simulated):
    bands = points_of_a_car_by_range(real), points_of_a_car_by_range(simulated)
    both = np.isfinite(bands[0]) & np.isfinite(bands[1])
    assert both.sum() >= 2
    ratio = bands[1][both] / bands[0][both]
    assert ((ratio > 1 / 3) & (ratio < 3)).all()


def test_masks_of_cars_overlap_their_points_alike(real, simulated):
    precision, recall = overlap_of_cars(simulated)
    real_precision, real_recall = overlap_of_cars(real)
    assert precision == pytest.approx(real_precision, abs=0.15)
    assert recall == pytest.approx(real_recall, abs=0.15)
