"""Maps of drives: against voxels counted one by one, and what stands still in a simulated drive."""

import re
from collections import Counter, defaultdict
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import ldls
from conftest import moved, pinhole
from ldls.sequences import labelled_map

CAMERA, MASKS = pinhole(), ldls.InstanceMasks.from_boxes([], (60, 80))
TEMPLATE = ldls.segment(np.zeros((1, 3)), MASKS, CAMERA)
OBJECTS = ((3, 1), (3, 2), (1, 3))
"""Category and track of the labels 1, 2 and 3."""


def added(places, points, labels, confidence=None, pose=None, objects=OBJECTS, stamp=0.0, moving=()):
    """Add points that have labels."""
    points, labels = np.asarray(points, float), np.asarray(labels, np.int32)
    instances = tuple(
        ldls.Instance(
            label=label, category=category, name="thing", score=1.0, sources=(), track=track,
            velocity=(1.0 * (label in moving), 0.0),
        )
        for label, (category, track) in enumerate(objects, start=1)
    )  # fmt: skip
    confidence = np.ones(len(points)) if confidence is None else confidence
    result = replace(
        TEMPLATE, points=points, labels=labels, instances=instances, confidence=np.asarray(confidence, np.float32)
    )
    places.add(ldls.Sweep(points, [], np.eye(4) if pose is None else pose, stamp), result)
    return places


def drive(seed, n_sweeps=5):
    """Sweeps of points in a few voxels, with labels at random; some are not finite or out of view."""
    generator = np.random.default_rng(seed)
    for number in range(n_sweeps):
        points = generator.uniform(-1, 1, (200, 3))
        points[generator.integers(200, size=5), generator.integers(3, size=5)] = [np.nan, np.inf, -np.inf, np.nan, 1]
        labels = generator.choice([-1, 0, 1, 2, 3], 200)
        yield points, labels, generator.uniform(0, 1, 200), moved(500.0 + 0.01 * number, -30, 5e5, 0.1 * number)


def counted(sweeps, voxel_m, left_out=()):
    """By voxel: mean, category, track and confidence of the winner, in plain Python."""
    of_voxel = defaultdict(list)
    for points, labels, confidence, pose in sweeps:
        for point, label, sure in zip(points.tolist(), labels.tolist(), confidence.tolist(), strict=True):
            name = (0, 0) if label == 0 else OBJECTS[label - 1]
            if label >= 0 and np.isfinite(point).all() and name[1] not in left_out:
                place = pose[:3, :3] @ point + pose[:3, 3]
                of_voxel[tuple(np.floor(place / voxel_m).astype(int).tolist())].append((place, name, sure))
    voxels = {}
    for cell, votes in of_voxel.items():
        counts = Counter(name for _, name, _ in votes)
        winner = min(counts, key=lambda name: (-counts[name], name))
        sure = sum(sure for _, name, sure in votes if name == winner) / len(votes)
        voxels[cell] = (np.mean([place for place, _, _ in votes], axis=0), *winner, sure)
    return voxels


@pytest.mark.parametrize(("seed", "voxel_m"), list(product(range(3), [0.5, 0.25, 2.0])))
@pytest.mark.parametrize("at_once", [1, 300, 10**6])
def test_voxels_are_those_counted_one_by_one(seed, voxel_m, at_once, monkeypatch):
    monkeypatch.setattr(labelled_map, "ROWS_AT_ONCE", at_once)
    places = ldls.LabelledMap(voxel_m)
    for points, labels, confidence, pose in drive(seed):
        added(places, points, labels, confidence, pose)
    expected = counted(drive(seed), voxel_m)
    assert len(places) == len(places.points) == len(expected)
    # the objects fill the same room in every sweep, and stand still
    assert set(places.tracks.tolist()) >= ({0} if voxel_m == 2.0 else {0, 1, 2, 3})
    for point, category, track, sure in zip(
        places.points, places.categories, places.tracks, places.confidence, strict=True
    ):
        mean, *name, share = expected.pop(tuple(np.floor(point / voxel_m).astype(int).tolist()))
        assert [category, track] == name and sure == pytest.approx(share, abs=1e-6)
        np.testing.assert_allclose(point, mean, rtol=0, atol=1e-9)
    assert not expected


def car(generator, n=100):
    return generator.uniform([-2, -0.9, 0], [2, 0.9, 1.5], (n, 3))


def test_what_moves_is_left_out_and_what_shows_another_side_is_not():
    generator, places = np.random.default_rng(0), ldls.LabelledMap(0.2)
    rear = generator.uniform([-2, 9.1, 0], [-1.7, 10.9, 1.5], (100, 3))
    for number in range(10):
        parked = rear if number < 4 else car(generator) + np.array([0, 10, 0])
        moving = car(generator) + np.array([0.4 * number, 0, 0])
        standing = generator.uniform([-0.3, 20, 0], [0.3, 20.4, 1.8], (50, 3))
        world = np.vstack([parked, moving, standing])
        labels = np.repeat([1, 2, 3], [len(parked), len(moving), len(standing)])
        pose = moved(0.5 * number, yaw=0.02 * number)
        added(places, (world - pose[:3, 3]) @ pose[:3, :3], labels, pose=pose, stamp=0.1 * number)
        # the car must have moved by half of its length, and what is known later goes for what was added before
        assert number in (4, 5, 6) or (2 in places.tracks) == (number < 4)
    assert set(places.tracks.tolist()) == {1, 3}
    assert places.points[:, 1].min() > 8, "where the car drove is nothing"


def test_a_label_that_leaks_in_a_few_points_does_not_move_an_object():
    generator, places = np.random.default_rng(0), ldls.LabelledMap(0.2)
    for number in range(4):
        points = car(generator)
        points[:5, 0] += [8, -8][number % 2]
        added(places, points, np.ones(100), stamp=number)
    assert set(places.tracks.tolist()) == {1}


@pytest.mark.parametrize(
    ("n_sweeps", "n_moving", "stays"),
    [
        pytest.param(10, 9, False, id="nine of ten sweeps"),
        pytest.param(11, 9, True, id="fewer"),
        pytest.param(9, 9, True, id="seen too seldom to tell"),
    ],
)
def test_what_has_a_velocity_nearly_always_is_left_out_though_its_label_was_long_once(n_sweeps, n_moving, stays):
    generator, places = np.random.default_rng(0), ldls.LabelledMap(0.2)
    for number in range(n_sweeps):
        walker = generator.uniform([-0.3, -0.3, 0], [0.3, 0.3, 1.8], (50, 3)) + np.array([0.12 * number, 0, 0])
        if number == 5:
            walker[::4, 0] += 2
        moving = [1] if number >= n_sweeps - n_moving else []
        added(places, walker, np.ones(50), stamp=number, moving=moving)
    assert (1 in places.tracks) == stays


def test_ties_go_to_the_background_then_to_the_lowest_category():
    places = added(ldls.LabelledMap(1.0), [[0.2, 0.2, 0.2]] * 3, [2, 3, 0], [0.9, 0.9, 0.6])
    assert (places.categories.tolist(), places.tracks.tolist()) == ([0], [0])
    assert places.confidence.tolist() == pytest.approx([0.2])
    places = added(ldls.LabelledMap(1.0), [[0.2, 0.2, 0.2]] * 3, [2, 1, 3])
    assert (places.categories.tolist(), places.tracks.tolist()) == ([1], [3])


def test_points_out_of_view_are_not_in_it():
    places = added(ldls.LabelledMap(), [[0, 0, 0], [5, 5, 5]], [0, -1])
    np.testing.assert_array_equal(places.points, [[0, 0, 0]])


def test_an_empty_map_has_no_voxels():
    for places in (ldls.LabelledMap(), added(ldls.LabelledMap(), np.zeros((0, 3)), [])):
        assert len(places) == 0 and places.points.shape == (0, 3)
        assert len(places.categories) == len(places.tracks) == len(places.confidence) == 0


def test_memory_is_that_of_the_voxels():
    places = ldls.LabelledMap(0.5)
    generator = np.random.default_rng(0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(labelled_map, "ROWS_AT_ONCE", 1000)
        sizes = []
        for number in range(40):
            added(places, generator.uniform(-2, 2, (5000, 3)), np.zeros(5000), stamp=number)
            sizes.append(len(places._rows.voxels) + sum(len(each.voxels) for each in places._new))
    assert max(sizes) <= 2 * 8**3 + 1000


def test_a_world_may_be_large():
    far = moved(4.5e5, 5.4e6, 100)
    places = added(ldls.LabelledMap(0.1), [[0.01, 0.01, 0.01], [0.02, 0.02, 0.02], [9, 0, 0]], [0, 0, 0], pose=far)
    np.testing.assert_allclose(np.sort(places.points[:, 0] - 4.5e5), [0.015, 9], atol=1e-6)


@pytest.mark.parametrize("voxel_m", [0, -1, np.nan, np.inf, 1e308, "0.1", True, None])
def test_voxels_have_a_size(voxel_m):
    with pytest.raises(ldls.ParameterError, match="^voxel_m: "):
        ldls.LabelledMap(voxel_m)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        pytest.param({"pose": moved(1e6)}, ldls.LimitError, "one is 1e+06 m from where the grid begins", id="far"),
        pytest.param({"points": [[9e6, 0, 0]]}, ldls.LimitError, "9e+06 m from where the grid begins", id="far point"),
        pytest.param({"points": [[1e300, 0, 0]]}, ldls.InputError, "row 0 has a coordinate of 1e+300 m", id="huge"),
        pytest.param({"labels": [0, 0]}, ldls.ShapeError, "result: has 2 points, the sweep 1; give", id="other points"),
        pytest.param({"labels": [1], "objects": [(3, 0)]}, ldls.InputError,
                     "result: instance 1 (thing) has points and no track", id="no track"),
    ],
)  # fmt: skip
def test_what_cannot_be_added_is_refused_and_changes_nothing(change, error, message):
    places = added(ldls.LabelledMap(), [[1, 2, 3]], [0])
    with pytest.raises(error, match=re.escape(message)):
        added(places, **{"points": [[4, 5, 6]], "labels": [0], **change})
    np.testing.assert_allclose(places.points, [[1, 2, 3]])
    assert len(added(places, [[4, 5, 6]], [0])) == 2


def test_a_world_too_large_for_the_voxels_is_refused():
    with pytest.raises(ldls.LimitError, match=re.escape("coordinates up to 1e+15 m are 0.125 m apart at best")):
        added(ldls.LabelledMap(), [[0, 0, 0]], [0], pose=moved(1e15))


@pytest.mark.parametrize("at_once", [1, 10**6])
def test_a_map_has_a_limit_and_stays_what_it_was(monkeypatch, at_once):
    monkeypatch.setattr(labelled_map, "ROWS_AT_ONCE", at_once)
    monkeypatch.setattr(labelled_map, "MOST_ROWS", 50)
    line = np.column_stack([np.arange(30.0), np.zeros(30), np.zeros(30)])
    places = added(ldls.LabelledMap(), line, np.zeros(30))
    added(places, line, np.zeros(30))
    with pytest.raises(ldls.LimitError, match="map: more than 50 voxels of 0.1 m; take larger ones"):
        added(places, line + np.array([0, 1, 0]), np.zeros(30))
    assert len(places) == 30
    assert len(added(places, line[:20] + np.array([0, 1, 0]), np.zeros(20))) == 50
