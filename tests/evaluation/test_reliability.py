"""Confidence held against truth."""

import math

import numpy as np
import pytest

from evaluation.samples import disturbed, labeling, random_labeling
from ldls.errors import InputError, ShapeError
from ldls.evaluation import ClassSet, Pair, evaluate
from ldls.evaluation.reliability import Bins, Reliability

CLASSES = ClassSet(names=("class 1", "class 2"))


def binned(confidence, right, number=15):
    bins = Bins(number)
    bins.add(np.array(confidence), np.array(right, bool))
    return bins


def error_by_loops(confidence, right, number=15):
    """Expected calibration error, point by point."""
    error = 0.0
    for b in range(number):
        members = [i for i, c in enumerate(confidence) if min(math.floor(c * number), number - 1) == b]
        if members:
            accuracy = sum(bool(right[i]) for i in members) / len(members)
            sure = sum(float(confidence[i]) for i in members) / len(members)
            error += len(members) / len(confidence) * abs(accuracy - sure)
    return error


def test_a_case_worked_by_hand():
    bins = binned([1.0, 1.0, 0.5, 0.5, 0.0], [1, 0, 1, 1, 0])
    # 2 of 5 points are 0.5 too sure, 2 are 0.5 too unsure, and the last is as it says
    assert bins.calibration_error == pytest.approx(2 / 5 * 0.5 + 2 / 5 * 0.5)
    assert bins.points[[0, 7, 14]].tolist() == [1, 2, 2]
    assert (bins.right.sum(), bins.confidence.sum()) == (3, 3.0)


def test_the_calibration_error_is_that_of_loops():
    generator = np.random.default_rng(1)
    for _ in range(50):
        confidence = generator.beta(2, 0.6, int(generator.integers(1, 300)))
        right = generator.random(len(confidence)) < confidence ** generator.uniform(0.2, 5)
        assert binned(confidence, right).calibration_error == pytest.approx(error_by_loops(confidence, right))


def test_confidences_that_come_true_have_no_calibration_error():
    generator = np.random.default_rng(2)
    confidence = generator.random(400_000)
    assert binned(confidence, generator.random(400_000) < confidence).calibration_error < 0.005


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_coverage_and_precision_are_those_of_each_threshold(kind):
    generator = np.random.default_rng(3)
    # confidences at thresholds too
    confidence = np.concatenate([generator.random(200), np.arange(0, 90) / 100]).astype(kind)
    right = generator.random(len(confidence)) < 0.7
    found = binned(confidence, right, 100).from_thresholds()
    for threshold, coverage, precision in found:
        kept = [bool(r) for c, r in zip(confidence.tolist(), right, strict=True) if c >= threshold]
        assert coverage == pytest.approx(len(kept) / len(confidence))
        assert precision == pytest.approx(sum(kept) / len(kept))
    assert found[0][:2] == (0.0, 1.0)
    assert [round(100 * row[0]) for row in found] == list(range(len(found)))


def test_without_points_there_is_nothing_to_score():
    assert Bins(15).calibration_error is None
    assert Bins(15).from_thresholds() == ()


def test_only_points_that_count_do():
    truth = labeling([0, 1, 1, 2, 0, 1], ignored=[5])
    prediction = labeling([0, 1, 2, 2, 1, 1], ignored=[4])
    found = Reliability()
    found.add(prediction, truth, np.array([0.1, 0.9, 0.5, 0.7, 1.0, 1.0]))
    assert (found.points.points.sum(), found.points.right.sum()) == (4, 3)
    assert found.points.confidence.sum() == pytest.approx(2.2)
    # the first is background
    assert (found.objects.points.sum(), found.objects.right.sum()) == (3, 2)
    assert found.by_threshold.from_thresholds()[60][1:] == (2 / 3, 1.0)


def test_frames_are_scored_by_their_classes():
    generator = np.random.default_rng(4)
    pairs, confidences, rights = [], [], []
    for name in "abc":
        truth = random_labeling(generator, 80, 3)  # the third class is not scored
        pair = Pair(name, disturbed(generator, truth, 0.4), truth, confidence=generator.random(80).astype(np.float32))
        pairs.append(pair)
        for i in range(80):
            if not (truth.ignored[i] or pair.prediction.ignored[i]):
                ours, theirs = (int(each.classes[i]) % 3 for each in (pair.prediction, truth))
                confidences.append(pair.confidence[i])
                rights.append(ours == theirs)
    classes = ClassSet(names=("class 1", "class 2"), background=("class 3",))
    found = evaluate(pairs, classes=classes).reliability
    assert found.points.points.sum() == len(rights)
    assert found.points.calibration_error == pytest.approx(error_by_loops(confidences, rights))
    # one frame that tells no confidence leaves nothing to hold against truth
    silent = Pair("d", pairs[0].prediction, pairs[0].truth)
    assert evaluate([silent, *pairs], classes=classes).reliability is None
    assert evaluate([*pairs, silent], classes=classes).reliability is None
    assert evaluate([], classes=classes).reliability is None


@pytest.mark.parametrize("wrong", [-0.1, 1.1, float("nan")])
def test_a_confidence_is_from_0_to_1(wrong):
    with pytest.raises(InputError, match="frame a: expected confidence from 0 to 1"):
        Pair("a", labeling([0, 1]), labeling([0, 1]), confidence=np.array([0.5, wrong]))


def test_a_confidence_is_told_for_each_point():
    with pytest.raises(ShapeError, match=r"frame a: confidence: expected shape \(2,\), got \(1,\)"):
        Pair("a", labeling([0, 1]), labeling([0, 1]), confidence=np.array([0.5]))
