"""The methods that are compared."""

import numpy as np
import pytest

import ldls
from ldls.evaluation import methods


def test_direct_projection_takes_the_label_of_the_nearest_pixel(small_scene):
    points, masks, camera = small_scene
    labels = ldls.segment(points, masks, camera).direct_labels
    rows, pixels = ldls.stages.project(points, camera, image_size=masks.image_size)
    expected = np.full(len(points), -1)
    for row, (u, v) in zip(rows, np.floor(pixels + 0.5).astype(int), strict=True):
        inside = [m for m, mask in enumerate(masks.to_array(), start=1) if mask[v, u]]
        expected[row] = min(inside, default=0)
    np.testing.assert_array_equal(labels, expected)


def test_an_instance_keeps_its_largest_cluster():
    pytest.importorskip("sklearn")
    generator = np.random.default_rng(3)
    points = np.vstack([generator.normal([x, 0, 0], 0.1, (n, 3)) for x, n in ((0, 30), (5, 20), (9, 25), (20, 2))])
    labels = np.repeat(np.array([1, 1, 2, 0], np.int32), (30, 20, 25, 2))
    kept = methods.largest_clusters(points, labels)
    np.testing.assert_array_equal(kept, np.repeat([1, 0, 2, 0], (30, 20, 25, 2)))


@pytest.mark.parametrize("count", [1, 4], ids=["a single point", "fewer than make a cluster"])
def test_points_too_few_for_a_cluster_become_background(count):
    pytest.importorskip("sklearn")
    labels = methods.largest_clusters(np.zeros((count, 3)), np.ones(count, np.int32))
    np.testing.assert_array_equal(labels, 0)


def test_every_method_labels_every_point(small_scene):
    pytest.importorskip("sklearn")
    points, masks, camera = small_scene
    result = ldls.segment(points, masks, camera)
    found = methods.compare(result)
    assert list(found) == ["direct projection", "project + DBSCAN", "diffusion, no outlier removal", "ldls"]
    np.testing.assert_array_equal(found[methods.FULL], result.labels)
    np.testing.assert_array_equal(found[methods.DIFFUSION], result.diffused_labels)
    for labels in found.values():
        np.testing.assert_array_equal(labels >= 0, result.labels >= 0)
