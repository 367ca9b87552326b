import numpy as np
import pytest

from evaluation.samples import labeling
from ldls.errors import InputError, ParameterError, ShapeError
from ldls.evaluation import ClassSet, Counts, Pair, evaluate, object_scores

CLASSES = ClassSet.kitti()


def pair(name="a", **fields):
    truth = labeling([1, 1, 2, 0], [1, 1, 1, 0])
    prediction = labeling([1, 0, 2, 2], [5, 0, 1, 1])
    return Pair(**({"name": name, "prediction": prediction, "truth": truth} | fields))


def test_all_scores_come_of_one_walk_over_the_frames():
    found = evaluate((pair(name) for name in "ab"), classes=CLASSES)
    assert found.names == ("Car", "Pedestrian")
    assert found.semantic["Car"] == Counts(2, 0, 2)
    assert found.instance["Car", 0.5] == Counts(tp=2)
    assert found.instance["Car", 0.7] == Counts(fp=2, fn=2)
    assert found.panoptic["Pedestrian"].counts == Counts(fp=2, fn=2)
    assert [(frame.name, frame.n_points, frame.n_counted) for frame in found.frames] == [("a", 4, 4), ("b", 4, 4)]
    assert found.frames[0].classes["Pedestrian"] == Counts(1, 1, 0)


def test_tuples_will_do():
    made = pair()
    found = evaluate([("a", made.prediction, made.truth)], classes=CLASSES, thresholds=(0.25,))
    assert found.instance["Car", 0.25] == Counts(tp=1)


def test_far_points_and_those_without_a_range_do_not_count():
    far = pair(ranges_m=np.array([5.0, 30.0, 20.0, np.nan]))
    found = evaluate([far], classes=CLASSES, max_range_m=20)
    assert found.semantic["Car"] == Counts(tp=1)
    assert found.semantic["Pedestrian"] == Counts(tp=1)
    assert found.frames[0].n_counted == 2
    assert evaluate([far], classes=CLASSES).frames[0].n_counted == 3


def test_small_objects_can_be_left_out():
    found = evaluate([pair()], classes=CLASSES, minimum_points=2)
    assert found.instance["Pedestrian", 0.5].fn == 0
    assert found.instance["Car", 0.5] == Counts(tp=1)


def test_no_frame_has_no_score():
    found = evaluate([], classes=CLASSES)
    assert found.semantic["Car"].iou is None
    assert found.frames == ()


def test_objects_have_a_range_and_an_iou():
    ranges = np.array([4.0, 6.0, 20.0, 9.0])
    car, person = object_scores(pair(ranges_m=ranges), classes=CLASSES)
    assert (car.name, car.instance, car.n_points, car.range_m, car.iou) == ("Car", 1, 2, 5.0, 0.5)
    assert (person.name, person.range_m, person.iou) == ("Pedestrian", 20.0, 0.5)
    with pytest.raises(InputError, match="frame a: the ranges of objects need"):
        object_scores(pair(), classes=CLASSES)


def test_errors_name_the_frame():
    with pytest.raises(ShapeError, match="frame a: prediction has 1 points, truth 4"):
        pair(prediction=labeling([1]))
    with pytest.raises(ShapeError, match=r"frame a: ranges_m: expected shape \(4,\), got \(3,\)"):
        pair(ranges_m=np.zeros(3))
    with pytest.raises(InputError, match="max_range_m: frame a has no ranges of its points; give its ranges_m="):
        evaluate([pair()], classes=CLASSES, max_range_m=10)
    unknown = labeling([1, 1, 1, 1], names=("background", "gnome"))
    with pytest.raises(InputError, match="frame a: truth has points of \\['gnome'\\]"):
        evaluate([pair(truth=unknown)], classes=CLASSES)
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(ParameterError, match="max_range_m: got"):
            evaluate([pair()], classes=CLASSES, max_range_m=wrong)
