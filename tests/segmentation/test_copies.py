"""Inputs and results survive pickling and copying, as process pools and data loaders do it."""

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import ldls

WAYS = [
    pytest.param(lambda value: pickle.loads(pickle.dumps(value)), id="pickle"),
    pytest.param(copy.deepcopy, id="deepcopy"),
    pytest.param(copy.copy, id="copy"),
]


@pytest.mark.parametrize("again", WAYS)
def test_masks_and_views(small_scene, again):
    points, masks, camera = small_scene
    view = again(ldls.View(masks, camera))
    assert view.masks.names == masks.names
    for name in ("categories", "scores"):
        np.testing.assert_array_equal(getattr(view.masks, name), getattr(masks, name))
    np.testing.assert_array_equal(view.masks.to_array(), masks.to_array())
    np.testing.assert_array_equal(again(masks[0]).to_array(), masks[0].to_array())
    expected = ldls.segment(points, masks, camera)
    np.testing.assert_array_equal(ldls.segment(points, view.masks, view.camera).labels, expected.labels)


@pytest.mark.parametrize("again", WAYS)
def test_results(small_scene, again):
    result = ldls.segment(*small_scene)
    copied = again(result)
    for name in ("labels", "diffused_labels", "confidence", "in_view", "points"):
        np.testing.assert_array_equal(getattr(copied, name), getattr(result, name))
    assert (copied.report, copied.params, copied.instances) == (result.report, result.params, result.instances)
    assert [each.n_points for each in copied.objects] == [each.n_points for each in result.objects]
    np.testing.assert_array_equal(copied.views[0].pixels, result.views[0].pixels)


def test_a_pool_of_processes(small_scene):
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        result = pool.submit(ldls.segment, *small_scene).result()
    np.testing.assert_array_equal(result.labels, ldls.segment(*small_scene).labels)


def test_objects_can_be_looked_for_and_counted(small_scene):
    one, other = (ldls.segment(*small_scene).objects for _ in range(2))
    assert one[0] in other and one == other
    assert len({*one, *other}) == len(one) and one[0].box == other[0].box
