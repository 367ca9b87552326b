import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls.labeling import Labeling

CAMERA = ldls.Camera(projection=[[700, 0, 300], [0, 700, 100], [0, 0, 1]], image_size=(200, 600))
PIXELS = np.zeros((2, 200, 600), bool)
PIXELS[0, 50:150, 100:300] = PIXELS[1, :80, 400:] = True
MASKS = ldls.InstanceMasks.from_array(PIXELS, categories=[3, 1], scores=[0.9, 0.8])
POINTS = np.random.default_rng(0).uniform([-3, -1, 4], [3, 1, 9], (300, 3))
RESULT = ldls.segment(np.vstack([POINTS, [[np.nan, 0, 0]]]), MASKS, CAMERA)
VIEW = ldls.View(MASKS, CAMERA)
LABELING = Labeling([0, 1], [0, 2], [False, True], ("background", "car"))
TRAJECTORY = ldls.Trajectory([0.0, 0.1], np.stack([np.eye(4)] * 2))
SWEEP = ldls.Sweep(POINTS, [VIEW], np.eye(4), 0.0)


@pytest.mark.parametrize(
    ("noun", "other"),
    [
        pytest.param(CAMERA, replace(CAMERA, min_depth_m=0.2), id="camera"),
        pytest.param(CAMERA, replace(CAMERA, projection=CAMERA.projection * [[2], [2], [1]]), id="a camera's matrix"),
        pytest.param(CAMERA, replace(CAMERA, image_size=None), id="a camera's image"),
        pytest.param(MASKS, MASKS.grow(1), id="masks by their pixels"),
        pytest.param(MASKS, MASKS.select([0]), id="masks by their number"),
        pytest.param(MASKS, ldls.InstanceMasks.from_array(PIXELS, categories=[3, 1]), id="masks by their scores"),
        pytest.param(MASKS[0], MASKS[1], id="mask"),
        pytest.param(VIEW, replace(VIEW, name="left"), id="view"),
        pytest.param(RESULT, ldls.segment(RESULT.points, MASKS, CAMERA, params=ldls.Params.paper()), id="result"),
        pytest.param(RESULT, replace(RESULT, confidence=RESULT.confidence / 2), id="a result's confidence"),
        pytest.param(RESULT.views[0], replace(RESULT.views[0], labels=np.array([2, 1])), id="view with its points"),
        pytest.param(RESULT.objects[0], RESULT.objects[1], id="object"),
        pytest.param(RESULT.objects[0].box, RESULT.objects[1].box, id="box"),
        pytest.param(LABELING, replace(LABELING, instances=[0, 3]), id="labeling"),
        pytest.param(TRAJECTORY, replace(TRAJECTORY, stamps=[0.0, 0.2]), id="trajectory"),
        pytest.param(SWEEP, replace(SWEEP, stamp=1.0), id="sweep"),
    ],
)
def test_nouns_are_equal_where_they_hold_the_same(noun, other):
    assert noun == copy.deepcopy(noun)
    assert noun == pickle.loads(pickle.dumps(noun))
    assert noun != other
    assert noun != "a noun"
    assert len({noun, copy.deepcopy(noun), other}) == 2


def test_a_second_run_has_an_equal_result_whatever_time_it_took():
    again = ldls.segment(RESULT.points, MASKS, CAMERA)
    assert again == RESULT
    assert again.timings != RESULT.timings
