"""What masks allow at best."""

from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls.evaluation import ClassSet, Labeling, bound_labels
from ldls.evaluation.on_masks import overlaps_with_masks, points_on_masks

pytest.importorskip("scipy")
CLASSES = ClassSet.kitti()
NAMES = ("background", "Pedestrian", "Car", "Van")


def random_frame(generator, camera, n_points=60, n_masks=5):
    """Points before a camera, masks that overlap one another, and truth in no relation to them but place."""
    points = generator.uniform([-3, -2, 8], [3, 2, 12], (n_points, 3))
    points[:3, 2] *= -1  # behind the camera
    pixels = np.zeros((n_masks, 60, 80), bool)
    for mask in pixels[:-1]:  # the last is empty
        top, left = generator.integers(0, 45), generator.integers(0, 60)
        mask[top : top + generator.integers(5, 30), left : left + generator.integers(5, 40)] = True
    masks = ldls.InstanceMasks.from_array(pixels, categories=generator.choice([1, 1, 3, 3, 7], n_masks))
    instances = np.where(points[:, 0] < generator.uniform(-2, 2), 1, 2) + 2 * (points[:, 1] < 0)
    instances[generator.random(n_points) < 0.3] = 0
    # numbers of instances repeat in other classes
    classes = np.where(instances > 0, generator.integers(1, 4, 5)[instances], 0)
    truth = Labeling(classes, np.minimum(instances, 3), generator.random(n_points) < 0.1, NAMES)
    return ldls.segment(points, masks, camera), truth


def masked_points(result):
    """The points on each instance, by their rounded pixels."""
    found = [set() for _ in result.instances]
    for seen in result.views:
        for label, mask in zip(seen.labels, seen.view.masks, strict=True):
            pixels = mask.to_array()
            for row, (u, v) in zip(seen.in_view, seen.pixels, strict=True):
                if pixels[int(np.floor(v + 0.5)), int(np.floor(u + 0.5))]:
                    found[label - 1].add(int(row))
    return found


def by_sets(result, truth):
    """The bound with sets of points: the best pair of all that are left, again and again."""
    scored = {"Pedestrian": ("person",), "Car": ("car",)}
    counted = {int(i) for i in result.in_view if not truth.ignored[i] and truth.names[truth.classes[i]] != "Van"}
    objects = {}
    for i in sorted(counted):
        key = (truth.names[truth.classes[i]], int(truth.instances[i]))
        if key[0] in scored and key[1] > 0:
            objects.setdefault(key, set()).add(i)
    masks = [points & counted for points in masked_points(result)]
    # of equals the first object, by class and number, and the first mask
    pairs = [
        (len(objects[key] & masks[m]) / len(objects[key] | masks[m]), key, m)
        for key in sorted(objects)
        for m, instance in enumerate(result.instances)
        if instance.name in scored[key[0]] and objects[key] & masks[m]
    ]
    labels = np.full(len(truth), -1)
    labels[result.in_view] = 0
    while pairs:
        _, key, m = max(pairs, key=lambda pair: pair[0])
        labels[list(objects[key])] = m + 1
        pairs = [pair for pair in pairs if pair[1] != key and pair[2] != m]
    return labels


def test_the_best_pairs_are_those_of_sets_of_points():
    generator = np.random.default_rng(4)
    camera = ldls.Camera(projection=[[100, 0, 40, 0], [0, 100, 30, 0], [0, 0, 1, 0]])
    found = 0
    for _ in range(200):
        result, truth = random_frame(generator, camera)
        labels = bound_labels(result, truth, CLASSES)
        np.testing.assert_array_equal(labels, by_sets(result, truth))
        found += len(np.unique(labels[labels > 0]))
    assert found > 150


def test_points_on_masks_are_those_of_rounded_pixels():
    generator = np.random.default_rng(8)
    left = ldls.Camera(projection=[[100, 0, 40, 0], [0, 100, 30, 0], [0, 0, 1, 0]])
    right = ldls.Camera(projection=[[100, 0, 55, 0], [0, 100, 30, 0], [0, 0, 1, 0]])
    for _ in range(10):
        result, _ = random_frame(generator, left)
        views = [ldls.View(result.masks, left), ldls.View(result.masks, right)]
        for each in (result, ldls.segment(result.points, views)):
            on = points_on_masks(each).toarray()
            assert [set(np.flatnonzero(column)) for column in on.T] == masked_points(each)


def test_overlaps_are_those_of_sets():
    from scipy.sparse import csr_array

    generator = np.random.default_rng(9)
    groups, on = generator.integers(-1, 4, 50), generator.random((50, 3)) < 0.4
    groups[groups == 1] = 3  # a number that no point has
    found = overlaps_with_masks(groups, csr_array(on.astype(np.int64)))
    assert found.shape == (4, 3)
    for g in range(4):
        for m in range(3):
            own, mask = set(np.flatnonzero(groups == g)), set(np.flatnonzero(on[:, m]))
            assert found[g, m] == len(own & mask) / max(len(own | mask), 1)


def test_a_mask_labels_one_object_and_all_of_it(small_scene):
    points, masks, camera = small_scene
    result = ldls.segment(points, masks, camera)
    # two people stand where the first mask, a person's, is, and more of the second one's points
    near = points[:, 2] < 12
    people = np.where(points[:, 0] < 0, np.where(points[:, 1] < 0.3, 2, 1), 3)
    truth = Labeling(
        np.where(near, np.where(people < 3, 1, 2), 0), np.where(near, people, 0), np.zeros(500, bool), NAMES
    )
    labels = bound_labels(result, truth, CLASSES)
    for instance, label in ((1, 0), (2, 1), (3, 2)):
        assert set(labels[truth.instances == instance]) == {label}
    assert set(labels[~near]) == {0}
    # without instances the people are one object, which the mask of most of them labels
    classes_alone = replace(truth, instances=np.zeros(500, int))
    assert {*bound_labels(result, classes_alone, CLASSES)[near & (people < 3)]} == {1}
    # a mask labels no object of another class
    swapped = replace(truth, names=("background", "Car", "Pedestrian", "Van"))
    assert not bound_labels(result, swapped, CLASSES).any()


def test_a_frame_without_masks_or_objects_has_only_background(small_scene):
    points, masks, camera = small_scene
    none = np.zeros(len(points), int)
    nothing = Labeling(none, none, none.astype(bool), NAMES)
    assert not bound_labels(ldls.segment(points, masks, camera), nothing, CLASSES).any()
    everything = replace(nothing, classes=none + 2, instances=none + 1)
    no_masks = ldls.segment(points, masks.select([]), camera)
    assert not bound_labels(no_masks, everything, CLASSES).any()
