"""The simulated street: its truth, its camera and its masks agree as a real frame's would."""

import numpy as np
import pytest

from ldls.simulation import SimulatedFrame, street_scene
from ldls.simulation.demo.layout import street
from ldls.simulation.demo.street import photograph

SEEDS = (0, 1, 2)


@pytest.fixture(scope="module", params=SEEDS)
def frame(request: pytest.FixtureRequest) -> SimulatedFrame:
    return street_scene(request.param)


def test_arrays_have_the_documented_shapes(frame: SimulatedFrame) -> None:
    n, m, (height, width) = len(frame.points), len(frame.masks), frame.image.shape[:2]
    assert 100_000 < n < 128_000
    assert (frame.points.shape, frame.truth.shape) == ((n, 4), (n,))
    assert frame.masks.shape == (m, height, width)
    assert frame.categories.shape == frame.scores.shape == (m,)
    assert frame.points.dtype == np.dtype(np.float32)
    assert frame.truth.dtype == np.dtype(np.int32)


def test_a_street_has_many_objects_of_several_categories(frame: SimulatedFrame) -> None:
    assert 9 <= len(frame.masks) <= 12
    assert len(set(frame.categories.tolist())) >= 5
    assert frame.truth.max() == len(frame.masks)
    assert (frame.masks.any(axis=(1, 2))).all()
    assert ((frame.scores >= 0.75) & (frame.scores <= 0.99)).all()


def test_points_are_those_of_a_lidar_on_a_car(frame: SimulatedFrame) -> None:
    range_m = np.linalg.norm(frame.points[:, :3], axis=1)
    assert range_m.min() > 3 and range_m.max() < 80.2
    ground = frame.points[(frame.truth == 0) & (np.abs(frame.points[:, 1]) < 1), 2]
    assert np.median(ground) == pytest.approx(-1.73, abs=0.02)
    assert ((frame.points[:, 3] >= 0) & (frame.points[:, 3] <= 1)).all()


def test_object_points_project_into_their_masks(frame: SimulatedFrame) -> None:
    labels, truth = _direct_projection(frame)
    for instance in range(1, len(frame.masks) + 1):
        found = labels[truth == instance, instance - 1]
        # A sliver of an object is what the cells of a mask render worst.
        assert found.mean() > (0.8 if len(found) > 100 else 0.4)


def test_direct_projection_is_good_but_not_perfect(frame: SimulatedFrame) -> None:
    labels, truth = _direct_projection(frame)
    of_object = truth[:, None] == np.arange(1, len(frame.masks) + 1)
    iou = (labels & of_object).sum(axis=0) / (labels | of_object).sum(axis=0)
    assert 0.7 < iou.mean() < 0.95


def _direct_projection(frame: SimulatedFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return, for the points in view, the masks over each (n, M) and its truth (n,)."""
    homogeneous = np.column_stack([frame.points[:, :3], np.ones(len(frame.points))])
    u, v, depth = frame.projection @ frame.T_camera_lidar @ homogeneous.T
    column, row = np.floor(np.stack([u, v]) / depth + 0.5).astype(int)
    height, width = frame.image.shape[:2]
    view = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return frame.masks[:, row[view], column[view]].T, frame.truth[view]


@pytest.mark.parametrize("seed", SEEDS)
def test_masks_are_nearly_the_silhouettes(seed: int) -> None:
    frame = street_scene(seed)
    solids, categories = street(np.random.default_rng(seed))
    image, owner = photograph(solids)
    np.testing.assert_array_equal(image, frame.image)
    silhouettes = [owner == m for m in range(1, len(categories) + 1)]
    ious = [max((mask & one).sum() / (mask | one).sum() for one in silhouettes) for mask in frame.masks]
    assert min(ious) > 0.5  # a bicycle's tubes are thinner than a mask's cells
    assert 0.8 < np.median(ious) < 0.98


def test_a_seed_is_a_street() -> None:
    first, again, other = street_scene(5), street_scene(5), street_scene(6)
    for name, value in vars(first).items():
        np.testing.assert_array_equal(value, getattr(again, name), err_msg=name)
    assert not np.array_equal(first.image, other.image)
    assert not np.array_equal(first.points[:1000], other.points[:1000])
