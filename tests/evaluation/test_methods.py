"""The methods that are compared."""

import numpy as np
import pytest

import ldls
from ldls.evaluation import ClassSet, Labeling, methods


def test_direct_projection_takes_the_label_of_the_nearest_pixel(small_scene):
    points, masks, camera = small_scene
    labels = ldls.segment(points, masks, camera).direct_labels
    rows, pixels = ldls.stages.project(points, camera, image_size=masks.image_size)
    expected = np.full(len(points), -1)
    for row, (u, v) in zip(rows, np.floor(pixels + 0.5).astype(int), strict=True):
        inside = [m for m, mask in enumerate(masks.to_array(), start=1) if mask[v, u]]
        expected[row] = min(inside, default=0)
    np.testing.assert_array_equal(labels, expected)


@pytest.fixture
def compared(small_scene):
    """Points, the results that are compared, the labels of every method, and the truth."""
    pytest.importorskip("sklearn")
    points, masks, camera = small_scene
    near = points[:, 2] < 12
    instances = np.where(near, np.where(points[:, 0] < 0, 1, 2), 0)
    truth = Labeling(instances, instances, np.zeros(len(points), bool), ("background", "Pedestrian", "Car"))
    full, paper = (ldls.segment(points, masks, camera, params=each) for each in (None, ldls.Params.paper()))
    return points, full, paper, methods.compare(full, paper, truth, ClassSet.kitti()), truth


def test_every_method_labels_every_point(compared):
    _, full, paper, found, _ = compared
    assert list(found) == [
        "direct projection",
        "project + DBSCAN",
        "clusters in the mask",
        "cluster ensemble",
        "diffusion, no outlier removal",
        "the paper's method",
        "ldls",
        "bound",
    ]
    np.testing.assert_array_equal(found[methods.FULL], full.labels)
    np.testing.assert_array_equal(found[methods.PAPER], paper.labels)
    np.testing.assert_array_equal(found[methods.DIFFUSION], paper.diffused_labels)
    for labels in found.values():
        assert labels.dtype == np.int32
        np.testing.assert_array_equal(labels >= 0, full.labels >= 0)


def test_the_bound_is_the_truth_where_each_object_has_its_mask(compared):
    *_, found, truth = compared
    seen = found[methods.BOUND] >= 0
    np.testing.assert_array_equal(found[methods.BOUND][seen], truth.instances[seen])


def test_clusters_have_no_point_of_the_ground(compared, monkeypatch):
    points, full, paper, found, truth = compared
    # what is below the middle lies on it, and one height is not known
    heights = np.where(points[full.in_view, 1] > 0, 0.1, 0.2)
    heights[5] = np.nan
    monkeypatch.setattr(methods.stages, "ground", lambda *_, **__: heights)
    standing = np.ones(len(points), bool)
    standing[full.in_view] = ~(heights < 0.2)
    cut = methods.compare(full, paper, truth, ClassSet.kitti())
    for name in (methods.IN_MASKS, methods.ENSEMBLE):
        assert set(cut[name][~standing]) == {0}
        assert set(cut[name][standing]) == {0, 1, 2}
    np.testing.assert_array_equal(cut[methods.CLUSTERING], found[methods.CLUSTERING])


def test_clusters_in_the_mask_are_those_of_dbscan(compared, monkeypatch):
    from sklearn.cluster import DBSCAN

    points, full, paper, _, truth = compared
    monkeypatch.setattr(methods.stages, "ground", lambda xyz, *_, **__: np.full(len(xyz), np.nan))
    found = methods.compare(full, paper, truth, ClassSet.kitti())
    expected = np.minimum(full.direct_labels, 0)
    for label in (1, 2):
        members = np.flatnonzero(full.direct_labels == label)
        numbers = DBSCAN(eps=1.2, min_samples=2).fit_predict(points[members])
        expected[members[numbers == np.bincount(numbers[numbers >= 0]).argmax()]] = label
    np.testing.assert_array_equal(found[methods.IN_MASKS], expected)
