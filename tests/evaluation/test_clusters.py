"""Clusters of points as instances."""

import numpy as np
import pytest

import ldls
from ldls.evaluation import clusters
from ldls.evaluation.on_masks import points_on_masks

pytest.importorskip("sklearn")


def groups(numbers):
    """The clusters as sets of points, whatever their numbers."""
    return {frozenset(np.flatnonzero(numbers == k).tolist()) for k in np.unique(numbers[numbers >= 0])}


def by_sklearn(points, radius_m):
    from sklearn.cluster import DBSCAN

    return DBSCAN(eps=radius_m, min_samples=2).fit_predict(points)


@pytest.mark.parametrize("radius_m", clusters.RADII_M)
@pytest.mark.parametrize("count", [1, 2, 40, clusters.CHUNK, 3 * clusters.CHUNK + 1])
def test_linked_points_are_the_clusters_of_dbscan_with_two_points(count, radius_m):
    generator = np.random.default_rng(count)
    points = generator.uniform(0, 0.8 * count ** (1 / 3), (count, 3))
    points[count // 2 :: 7] = points[count // 3]  # some in one place
    found = clusters.linked(points, radius_m)
    expected = by_sklearn(points, radius_m)
    assert groups(found) == groups(expected)
    np.testing.assert_array_equal(found < 0, expected < 0)


def test_a_chain_of_points_is_one_cluster_over_chunks():
    points = np.zeros((3 * clusters.CHUNK, 3))
    # neighbours in the chain are far apart in the array
    points[np.random.default_rng(1).permutation(len(points)), 0] = np.arange(len(points))
    assert groups(clusters.linked(points, 1.0)) == {frozenset(range(len(points)))}
    assert groups(clusters.linked(points, 0.9)) == set()


def test_no_points_are_no_clusters():
    assert len(clusters.linked(np.empty((0, 3)))) == 0


@pytest.mark.parametrize("clusterer", [clusters.dbscan, clusters.linked])
def test_an_instance_keeps_its_largest_cluster(clusterer):
    generator = np.random.default_rng(3)
    points = np.vstack([generator.normal([x, 0, 0], 0.1, (n, 3)) for x, n in ((0, 30), (5, 20), (9, 25), (20, 2))])
    labels = np.repeat(np.array([1, 1, 2, 0], np.int32), (30, 20, 25, 2))
    kept = clusters.largest_clusters(points, labels, clusterer)
    np.testing.assert_array_equal(kept, np.repeat([1, 0, 2, 0], (30, 20, 25, 2)))


@pytest.mark.parametrize("count", [1, 4], ids=["a single point", "fewer than make a cluster"])
def test_points_too_few_for_a_cluster_become_background(count):
    labels = clusters.largest_clusters(np.zeros((count, 3)), np.ones(count, np.int32))
    np.testing.assert_array_equal(labels, 0)


def best_by_sets(points, on):
    """Labels by the best clusters, with sets of points and all candidates."""
    found = []
    for m in range(on.shape[1]):
        mask = set(np.flatnonzero(on[:, m]))
        best = (0.0, None)
        for radius_m in (1.2, 0.8, 0.5, 0.3):
            for cluster in sorted(groups(by_sklearn(points, radius_m)), key=min):
                iou = len(cluster & mask) / len(cluster | mask)
                best = (iou, cluster) if iou > best[0] else best
        found.append(best)
    labels = [0] * len(points)
    for m in sorted(range(on.shape[1]), key=lambda m: -found[m][0]):
        for i in found[m][1] or ():
            labels[i] = labels[i] or m + 1
    return labels


def test_the_best_cluster_of_all_radii_becomes_the_instance():
    from scipy.sparse import csr_array

    generator = np.random.default_rng(5)
    labelled = 0
    for _ in range(40):
        middles = generator.uniform(-4, 4, (6, 3))
        points = np.concatenate([generator.normal(middle, 0.35, (12, 3)) for middle in middles])
        # masks around some of the points; they overlap, and one has no point
        on = np.stack([np.linalg.norm(points - middle, axis=1) < 1.2 for middle in middles[:3]] + [points[:, 0] > 99])
        labels = clusters.best_clusters(points, csr_array(on.T.astype(np.int64)))
        assert labels.tolist() == best_by_sets(points, on.T)
        labelled += (labels > 0).sum()
    assert labelled > 500


def test_no_points_have_no_best_cluster(small_scene):
    points, masks, camera = small_scene
    on = points_on_masks(ldls.segment(points, masks, camera))
    assert len(clusters.best_clusters(points[:0], on[:0])) == 0
