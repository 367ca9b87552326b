import numpy as np
import pytest
from sklearn.metrics import confusion_matrix

from evaluation.samples import NAMES, disturbed, labeling, random_labeling
from ldls.errors import ParameterError
from ldls.evaluation import Counts, SemanticScores


def test_a_case_worked_by_hand():
    truth = labeling([1, 1, 1, 2, 2, 0, 0, 1], ignored=[7])
    prediction = labeling([1, 1, 0, 1, 2, 2, 0, 2])
    scores = SemanticScores(NAMES[1:])
    scores.add(prediction, truth)
    assert scores["Car"] == Counts(tp=2, fp=1, fn=1)
    assert scores["Pedestrian"] == Counts(tp=1, fp=1, fn=1)
    assert scores["Car"].precision == scores["Car"].recall == pytest.approx(2 / 3)
    assert scores["Car"].iou == 0.5
    assert scores.mean_iou == pytest.approx((1 / 2 + 1 / 3) / 2)


def test_points_that_the_prediction_ignores_do_not_count():
    scores = SemanticScores(NAMES[1:])
    scores.add(labeling([0, 1], ignored=[0]), labeling([1, 1]))
    assert scores["Car"] == Counts(tp=1)


@pytest.mark.parametrize(
    ("counts", "expected"),
    [
        pytest.param(Counts(), (None, None, None, None), id="nothing to score"),
        pytest.param(Counts(fn=3), (0.0, 0.0, 0.0, 0.0), id="never predicted"),
        pytest.param(Counts(fp=3), (0.0, 0.0, 0.0, 0.0), id="only invented"),
        pytest.param(Counts(2, 0, 0), (1.0, 1.0, 1.0, 1.0), id="perfect"),
        pytest.param(Counts(1, 1, 2), (0.5, 1 / 3, 0.25, 0.4), id="mixed"),
    ],
)
def test_zero_denominators_are_defined(counts, expected):
    assert (counts.precision, counts.recall, counts.iou, counts.f1) == expected


def test_a_class_that_nobody_has_is_left_out_of_the_mean():
    scores = SemanticScores(NAMES[1:])
    scores.add(labeling([1, 0]), labeling([1, 0]))
    assert scores["Pedestrian"].iou is None
    assert scores.mean_iou == 1.0
    assert SemanticScores(NAMES[1:]).mean_iou is None


def test_confusion_is_scikit_learns_on_1000_random_labelings():
    generator = np.random.default_rng(1)
    merged, together = SemanticScores(("class 1", "class 2", "class 3")), 0
    for _ in range(1000):
        truth = random_labeling(generator, int(generator.integers(1, 60)), n_classes=3)
        prediction = disturbed(generator, truth, generator.random())
        scores = SemanticScores(truth.names[1:])
        scores.add(prediction, truth)
        counted = ~(truth.ignored | prediction.ignored)
        expected = np.zeros((4, 4), int)
        if counted.any():
            expected = confusion_matrix(truth.classes[counted], prediction.classes[counted], labels=range(4))
        np.testing.assert_array_equal(scores.confusion, expected)
        merged.merge(scores)
        together = together + expected
    np.testing.assert_array_equal(merged.confusion, together)


def test_labelings_of_other_classes_are_refused():
    scores = SemanticScores(("Car",))
    with pytest.raises(ParameterError, match="map it to them first"):
        scores.add(labeling([1]), labeling([1]))
    with pytest.raises(ParameterError, match="expected \\('Car',\\)"):
        scores.merge(SemanticScores(("Bus",)))
    with pytest.raises(KeyError, match="Bus"):
        scores["Bus"]
