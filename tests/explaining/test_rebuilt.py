"""The linear system built again from a result gives the result's labels."""

import numpy as np
import pytest
from scipy.sparse import csr_array

import ldls
from ldls import stages
from ldls.explaining import rebuild
from ldls.simulation import sample_frame
from ring_samples import as_views, random_ring, street_ring


def winners(result):
    system = rebuild(result)
    z = stages.diffuse(system.A, system.b, iterations=result.params.iterations)
    return system, z.argmax(axis=1)


def street(params=None):
    frame = sample_frame()
    (image,) = frame.images
    return ldls.segment(frame.points, image.masks, image.camera, params=params)


def ring(seed):
    points, views = random_ring(seed)
    params = ldls.Params(neighbors=6, sigma=0.3, pixel_weight=0.01, iterations=40)
    return ldls.segment(points, as_views(views), params=params)


@pytest.mark.parametrize(
    "result",
    [
        pytest.param(street, id="one camera, a simulated street"),
        pytest.param(lambda: street(ldls.Params.paper()), id="the paper's method"),
        pytest.param(lambda: street(ldls.Params(depth_gap=0)), id="ground alone"),
        pytest.param(lambda: street(ldls.Params(ground_edges=1, ground_clearance=0)), id="depth groups alone"),
        pytest.param(lambda: ldls.segment(*street_ring()), id="two cameras in a street"),
        *(pytest.param(lambda seed=seed: ring(seed), id=f"ring {seed}") for seed in range(5)),
    ],
)
def test_the_likelihoods_have_the_labels_of_the_result(result):
    result = result()
    system, found = winners(result)
    np.testing.assert_array_equal(found, result.diffused_labels[system.in_graph])
    assert not result.diffused_labels[np.setdiff1d(result.in_view, system.in_graph)].any()
    assert len(np.unique(result.diffused_labels)) > 2


def test_rows_sum_to_one_and_a_point_that_two_cameras_see_has_the_pixels_of_both():
    result = ring(3)
    system = rebuild(result)
    seen_by = np.sum([np.isin(system.in_graph, seen.in_view) for seen in result.views], axis=0)
    assert set(seen_by.tolist()) == {1, 2}
    full = result.params.pixel_weight * result.params.window**2
    assert (system.pixel_labels.mass <= full * seen_by + 1e-6).all()
    np.testing.assert_allclose(system.pixel_labels.mass.max(), 2 * full, rtol=1e-6)
    row_sums = system.graph.sum(axis=1) + system.pixel_labels.mass
    np.testing.assert_allclose(system.A.sum(axis=1) + system.pixel_labels.mass / row_sums, 1, rtol=1e-5)
    np.testing.assert_allclose((system.A.multiply(row_sums[:, None]) - system.graph).max(), 0, atol=1e-6)


@pytest.mark.parametrize("params", [ldls.Params(), ldls.Params.paper()], ids=["best", "paper"])
def test_outlier_removal_on_the_graph_has_the_labels_of_the_result(params):
    result = street(params)
    system = rebuild(result)
    diffused = result.diffused_labels[system.in_graph]
    labels = stages.remove_outliers(system.A, diffused, points=result.points[system.in_graph], part_gap=params.part_gap)
    np.testing.assert_array_equal(labels, result.labels[system.in_graph])
    paper = params == ldls.Params.paper()
    assert (system.heights is None) == (system.depths[0] is None) == paper
    assert (len(system.in_graph) == len(result.in_view)) == paper


def test_each_view_has_depth_groups_of_the_points_that_it_sees():
    result = ldls.segment(*street_ring())
    system = rebuild(result)
    assert system.heights.shape == result.in_view.shape
    for seen, depths in zip(result.views, system.depths, strict=True):
        assert len(depths.distances) == len(seen.in_view)
        assert len(depths.intervals) == len(seen.view.masks)
        xyz = seen.view.camera.T_camera_lidar @ np.c_[result.points[seen.in_view, :3], np.ones(len(seen.in_view))].T
        place = np.linalg.solve(seen.view.camera.projection[:, :3], seen.view.camera.projection[:, 3])
        np.testing.assert_allclose(depths.distances, np.linalg.norm(xyz[:3].T + place, axis=1), rtol=1e-5)


def test_points_before_and_behind_an_object_are_as_far_from_it_as_they_lie():
    intervals = np.array([[5.0, 7.0], [np.nan, np.nan]])
    depths = stages.DepthGroups(intervals, np.array([4.5, 5, 6, 7, 9]), np.array([0, 0, 0, 0, 1], bool))
    np.testing.assert_array_equal(depths.behind_m(0), [-0.5, 0, 0, 0, 2])
    assert np.isnan(depths.behind_m(1)).all()
    np.testing.assert_array_equal(depths.of_points([4, 0]).behind_m(0), [2, -0.5])
    assert depths.of_points([4, 0]).unsure.tolist() == [True, False]
    for rows in ([5], [-1]):
        with pytest.raises(ldls.InputError, match="expected rows of the 5 points"):
            depths.of_points(rows)


@pytest.mark.parametrize("kept", [0, 1], ids=["no point in view", "one point in view"])
def test_clouds_next_to_nothing_have_systems_as_small(small_scene, kept):
    points, masks, camera = small_scene
    whole = ldls.segment(points, masks, camera)
    result = ldls.segment(points[whole.in_view[:kept]], masks, camera)
    system, found = winners(result)
    assert isinstance(system.A, csr_array)
    assert system.A.shape == (kept, kept)
    assert system.b.shape == (kept, 3)
    np.testing.assert_array_equal(found, result.diffused_labels)
