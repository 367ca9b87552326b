"""The linear system built again from a result gives the result's labels."""

import numpy as np
import pytest
from scipy.sparse import csr_array

import ldls
from ldls import stages
from ldls.explaining import rebuild
from ldls.simulation import sample_frame
from ring_samples import as_views, random_ring


def winners(result):
    system = rebuild(result)
    z = stages.diffuse(system.A, system.b, iterations=result.params.iterations)
    return z.argmax(axis=1)


def street():
    frame = sample_frame()
    (image,) = frame.images
    return ldls.segment(frame.points, image.masks, image.camera)


def ring(seed):
    points, views = random_ring(seed)
    params = ldls.Params(neighbors=6, sigma=0.3, pixel_weight=0.01, iterations=40)
    return ldls.segment(points, as_views(views), params=params)


@pytest.mark.parametrize(
    "result",
    [
        pytest.param(street, id="one camera, a simulated street"),
        *(pytest.param(lambda seed=seed: ring(seed), id=f"ring {seed}") for seed in range(5)),
    ],
)
def test_the_likelihoods_have_the_labels_of_the_result(result):
    result = result()
    np.testing.assert_array_equal(winners(result), result.diffused_labels[result.in_view])
    assert len(np.unique(result.diffused_labels)) > 2


def test_rows_sum_to_one_and_a_point_that_two_cameras_see_has_the_pixels_of_both():
    result = ring(3)
    system = rebuild(result)
    seen_by = np.sum([np.isin(result.in_view, seen.in_view) for seen in result.views], axis=0)
    assert set(seen_by.tolist()) == {1, 2}
    full = result.params.pixel_weight * result.params.window**2
    assert (system.pixel_labels.mass <= full * seen_by + 1e-6).all()
    np.testing.assert_allclose(system.pixel_labels.mass.max(), 2 * full, rtol=1e-6)
    row_sums = system.graph.sum(axis=1) + system.pixel_labels.mass
    np.testing.assert_allclose(system.A.sum(axis=1) + system.pixel_labels.mass / row_sums, 1, rtol=1e-5)
    np.testing.assert_allclose((system.A.multiply(row_sums[:, None]) - system.graph).max(), 0, atol=1e-6)


@pytest.mark.parametrize("kept", [0, 1], ids=["no point in view", "one point in view"])
def test_clouds_next_to_nothing_have_systems_as_small(small_scene, kept):
    points, masks, camera = small_scene
    whole = ldls.segment(points, masks, camera)
    result = ldls.segment(points[whole.in_view[:kept]], masks, camera)
    system = rebuild(result)
    assert isinstance(system.A, csr_array)
    assert system.A.shape == (kept, kept)
    assert system.b.shape == (kept, 3)
    np.testing.assert_array_equal(winners(result), result.diffused_labels)
