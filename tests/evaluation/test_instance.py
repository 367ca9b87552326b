from itertools import permutations

import numpy as np
import pytest

from evaluation.samples import NAMES, disturbed, labeling, random_labeling
from ldls.errors import ParameterError
from ldls.evaluation import Counts, InstanceScores
from ldls.evaluation.instance import best_matches, instance_overlaps, matched_iou


def scored(prediction, truth, **options):
    scores = InstanceScores(truth.names[1:], **options)
    scores.add(prediction, truth)
    return scores


def test_a_case_worked_by_hand():
    # car 1 has IoU 3/4 with prediction 5, car 2 has 1/2 with 6, pedestrian 1 is missed, prediction 7 invented
    truth = labeling([1, 1, 1, 1, 1, 1, 2, 2, 0, 0], [1, 1, 1, 1, 2, 2, 1, 1, 0, 0])
    prediction = labeling([1, 1, 1, 0, 1, 0, 0, 0, 1, 1], [5, 5, 5, 0, 6, 0, 0, 0, 7, 7])
    scores = scored(prediction, truth)
    assert scores["Car", 0.5] == Counts(tp=2, fp=1, fn=0)
    assert scores["Car", 0.7] == Counts(tp=1, fp=2, fn=1)
    assert scores["Pedestrian", 0.5] == Counts(tp=0, fp=0, fn=1)
    assert scores["Pedestrian", 0.5].recall == 0.0


def test_the_sum_of_ious_is_larger_than_by_taking_the_best_pair_first():
    # the best pair, truth 1 with prediction 1, has IoU 1/2 and leaves truth 2 nothing; the others sum to 7/12
    truth = labeling([1] * 7, [1, 1, 1, 1, 2, 2, 2])
    prediction = labeling([1] * 7, [2, 1, 1, 1, 1, 1, 0])
    found = instance_overlaps(prediction, truth, "Car")
    np.testing.assert_allclose(found.iou, [[3 / 6, 1 / 4], [2 / 6, 0]])
    assert found.prediction_ids[best_matches(found)].tolist() == [2, 1]
    assert matched_iou(found, best_matches(found)).sum() == pytest.approx(1 / 4 + 2 / 6)


def test_iou_at_the_threshold_counts():
    truth = labeling([1] * 10, [1] * 10)
    prediction = labeling([1] * 7 + [0] * 3, [1] * 7 + [0] * 3)
    assert scored(prediction, truth)["Car", 0.7] == Counts(tp=1)


def test_small_truth_neither_helps_nor_hurts():
    truth = labeling([1, 1, 1, 1, 2], [1, 1, 1, 2, 1])
    prediction = labeling([1, 1, 1, 1, 0], [1, 1, 1, 2, 0])
    scores = scored(prediction, truth, minimum_points=2)
    assert scores["Car", 0.5] == Counts(tp=1)
    assert scores["Pedestrian", 0.5] == Counts()
    assert scored(prediction, truth)["Car", 0.5] == Counts(tp=2)


def test_ignored_points_and_truth_without_instances_are_dropped():
    truth = labeling([1, 1, 1, 2, 2], [1, 1, 1, 0, 0], ignored=[2])
    prediction = labeling([1, 1, 0, 2, 1], [4, 4, 0, 9, 4])
    scores = scored(prediction, truth)
    assert scores["Car", 0.7] == Counts(tp=1)
    assert scores["Pedestrian", 0.5] == Counts()
    assert scores["Pedestrian", 0.5].precision is None


def test_empty_frames_add_nothing():
    scores = scored(labeling([]), labeling([]))
    scores.add(labeling([0, 0]), labeling([0, 0]))
    assert scores["Car", 0.5] == Counts()


def all_matchings(iou):
    """Largest sum of IoUs over every one-to-one matching, by trying them all."""
    wide = iou if iou.shape[0] <= iou.shape[1] else iou.T
    rows = np.arange(wide.shape[0])
    return max(wide[rows, list(columns)].sum() for columns in permutations(range(wide.shape[1]), len(rows)))


def test_no_matching_has_a_larger_sum():
    generator = np.random.default_rng(2)
    several = 0
    for _ in range(300):
        truth = random_labeling(generator, 40, n_instances=4)
        prediction = disturbed(generator, truth, generator.random())
        for name in truth.names[1:]:
            found = instance_overlaps(prediction, truth, name)
            several += min(found.iou.shape) > 2
            matched = best_matches(found)
            used = matched[matched >= 0]
            assert len(set(used.tolist())) == len(used)
            np.testing.assert_allclose(matched_iou(found, matched).sum(), all_matchings(found.iou), atol=1e-12)
    assert several > 300


def test_ious_are_those_of_sets():
    generator = np.random.default_rng(3)
    for _ in range(100):
        truth = random_labeling(generator, 30)
        prediction = disturbed(generator, truth, 0.4)
        counted = ~(truth.ignored | prediction.ignored) & ~((truth.classes > 0) & (truth.instances == 0))
        found = instance_overlaps(prediction, truth, "class 1")

        def points(labels, instance, counted=counted):
            return set(np.flatnonzero(counted & (labels.classes == 1) & (labels.instances == instance)))

        for t, true in enumerate(found.truth_ids):
            for p, predicted in enumerate(found.prediction_ids):
                ours, theirs = points(prediction, predicted), points(truth, true)
                assert found.iou[t, p] == len(ours & theirs) / len(ours | theirs)


def test_frames_add_up():
    truth, prediction = labeling([1, 1], [1, 2]), labeling([1, 0], [1, 0])
    scores = scored(prediction, truth)
    scores.add(prediction, truth)
    assert scores["Car", 0.5] == Counts(tp=2, fn=2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param({"thresholds": (0.0,)}, "thresholds: got 0.0", id="zero"),
        pytest.param({"thresholds": (1.1,)}, "thresholds: got 1.1", id="over one"),
        pytest.param({"thresholds": (float("nan"),)}, "thresholds: got nan", id="nan"),
        pytest.param({"minimum_points": -1}, "minimum_points: got -1", id="negative minimum"),
    ],
)
def test_parameters_are_checked(options, message):
    with pytest.raises(ParameterError, match=message):
        InstanceScores(NAMES[1:], **options)
