import numpy as np
import pytest

from evaluation.samples import disturbed, labeling, random_labeling
from ldls.evaluation import Counts, PanopticQuality, PanopticScores


def quality_by_definition(prediction, truth, k, minimum_points):
    """(TP, FP, FN, sum of IoUs) of a class: every pair of segments, as sets of points."""
    counted = [i for i in range(len(truth)) if not (truth.ignored[i] or prediction.ignored[i])]

    def segments(labels):
        found = {}
        for i in counted:
            if labels.classes[i] == k:
                found.setdefault(int(labels.instances[i]), set()).add(i)
        return list(found.values())

    true, predicted = segments(truth), segments(prediction)
    matches = [(t, p) for t in true for p in predicted if len(t & p) / len(t | p) > 0.5]
    iou_sum = sum(len(t & p) / len(t | p) for t, p in matches)
    missed = [t for t in true if all(t is not m for m, _ in matches) and len(t) >= minimum_points]
    invented = [p for p in predicted if all(p is not m for _, m in matches) and len(p) >= minimum_points]
    return len(matches), len(invented), len(missed), iou_sum


def test_a_case_worked_by_hand():
    # IoU 3/4, then exactly 1/2, which is no match: one segment missed and one invented
    truth = labeling([1] * 6, [1, 1, 1, 1, 2, 2])
    prediction = labeling([1, 1, 1, 0, 1, 0], [1, 1, 1, 0, 2, 0])
    scores = PanopticScores(truth.names[1:])
    scores.add(prediction, truth)
    assert scores["Car"] == PanopticQuality(Counts(1, 1, 1), 0.75)
    assert (scores["Car"].sq, scores["Car"].rq, scores["Car"].pq) == (0.75, 0.5, 0.375)
    assert scores["Pedestrian"].pq is None
    assert scores.mean_pq == 0.375


def test_nothing_found_is_zero_and_nothing_there_is_none():
    missed = PanopticQuality(Counts(fn=2))
    assert (missed.pq, missed.sq, missed.rq) == (0.0, 0.0, 0.0)
    nothing = PanopticQuality()
    assert (nothing.pq, nothing.sq, nothing.rq) == (None, None, None)
    assert PanopticScores(("Car",)).mean_pq is None


def test_it_is_the_definition_on_1000_random_labelings():
    generator = np.random.default_rng(4)
    found_any = 0
    for _ in range(1000):
        truth = random_labeling(generator, int(generator.integers(0, 50)))
        prediction = disturbed(generator, truth, generator.random())
        minimum = int(generator.integers(0, 6))
        scores = PanopticScores(truth.names[1:], minimum_points=minimum)
        scores.add(prediction, truth)
        for k, name in enumerate(truth.names[1:], start=1):
            *counts, iou_sum = quality_by_definition(prediction, truth, k, minimum)
            assert scores[name].counts == Counts(*counts)
            assert scores[name].iou_sum == pytest.approx(iou_sum)
            found_any += counts[0] > 0 and counts[1] > 0 and counts[2] > 0
    assert found_any > 100


def test_frames_add_up():
    truth, prediction = labeling([1, 1], [1, 2]), labeling([1, 0], [1, 0])
    scores = PanopticScores(truth.names[1:])
    for _ in range(2):
        scores.add(prediction, truth)
    assert scores["Car"] == PanopticQuality(Counts(2, 0, 2), 2.0)
