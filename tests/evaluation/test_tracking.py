import math
import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from evaluation.samples import disturbed, labeling, random_labeling
from ldls.errors import ParameterError
from ldls.evaluation import ClassSet, Counts, TrackingScores, evaluate

NAMES = ("Car", "Pedestrian")


def scored(sweeps, names=NAMES, **options):
    scores = TrackingScores(names, **options)
    for prediction, truth in sweeps:
        scores.add(prediction, truth)
    return scores


def drive(*numbers, truth=(1, 1, 1, 1, 2, 2)):
    """Sweeps of two cars of 4 and 2 points; the prediction has the `numbers` a point, 0 for none."""
    return [(labeling(np.array(each) > 0, each), labeling([1] * len(truth), truth)) for each in numbers]


def instances_of(labels, counted):
    """Points of each (class, number)."""
    found = {}
    for i in counted:
        if labels.classes[i] and labels.instances[i]:
            found.setdefault((int(labels.classes[i]), int(labels.instances[i])), set()).add(i)
    return found


def iou(a, b):
    return len(a & b) / len(a | b)


def by_definition(sweeps, minimum):
    """(S_assoc, id switches, object frames, false positives), with every tube and instance as a set of points."""
    true_tubes, predicted_tubes, histories = {}, {}, {}
    frames = invented = 0
    for sweep, (prediction, truth) in enumerate(sweeps):
        counted = [i for i in range(len(truth)) if not (truth.ignored[i] or prediction.ignored[i])]
        true = instances_of(truth, counted)
        for key, points in true.items():
            if len(points) >= minimum:
                frames += 1
                true_tubes.setdefault(key, set()).update((sweep, i) for i in points)
        for i in counted:
            if prediction.instances[i]:
                predicted_tubes.setdefault(int(prediction.instances[i]), set()).add((sweep, i))
        # points of a true class without a number tell nothing of the instances of a sweep
        told = [i for i in counted if not truth.classes[i] or truth.instances[i]]
        for (k, number), points in instances_of(prediction, told).items():
            matched = [key for key, other in true.items() if key[0] == k and iou(points, other) > 0.5]
            invented += not matched
            for key in matched:
                histories.setdefault(key, []).extend([number] * (len(true[key]) >= minimum))
    sums = [sum(len(t & s) * iou(s, t) for s in predicted_tubes.values()) / len(t) for t in true_tubes.values()]
    switches = sum(a != b for each in histories.values() for a, b in pairwise(each))
    return (sum(sums) / len(sums) if sums else None), switches, frames, invented


def test_it_is_the_definition_on_500_random_drives():
    generator = np.random.default_rng(19)
    switches_in_all = some_between = 0
    for _ in range(500):
        sweeps = []
        share, shuffled = generator.random(2) * (0.6, 1)
        for _ in range(5):
            truth = random_labeling(generator, int(generator.integers(0, 40)))
            noisy = disturbed(generator, truth, share)
            numbers = np.arange(4)
            if generator.random() < shuffled:
                generator.shuffle(numbers[1:])
            sweeps.append((replace(noisy, instances=numbers[noisy.instances]), truth))
        names, minimum = truth.names[1:], int(generator.integers(0, 5))
        scores = scored(sweeps, names, minimum_points=minimum)
        s_assoc, switches, frames, invented = by_definition(sweeps, minimum)
        total = scores.total
        assert total.s_assoc == (None if s_assoc is None else pytest.approx(s_assoc))
        assert (total.id_switches, total.object_frames, total.counts.fp) == (switches, frames, invented)
        if frames:
            assert scores.lstq == pytest.approx(math.sqrt(s_assoc * scores.s_cls))
            assert total.motsa == (total.counts.tp - invented - switches) / frames
        switches_in_all += switches
        some_between += s_assoc is not None and 0.2 < s_assoc < 0.8
    assert switches_in_all > 500
    assert some_between > 100


RIGHT = (1, 1, 1, 1, 2, 2)
CASES = [
    # sweeps, S_assoc, id switches, MOTSA
    pytest.param([RIGHT] * 4, 1.0, 0, 1.0, id="as the truth"),
    pytest.param([(70_000, 70_000, 70_000, 70_000, 3, 3)] * 4, 1.0, 0, 1.0, id="other numbers, the same throughout"),
    pytest.param([(n, n, n, n, n + 9, n + 9) for n in range(1, 5)], 1 / 4, 6, 1 / 4, id="new numbers in every sweep"),
    # each number has 6 points, 4 of the large car's 8 and 2 of the small one's 4
    pytest.param([RIGHT, (2, 2, 2, 2, 1, 1)], (4 / (8 + 6 - 4) + 2 / (4 + 6 - 2)) / 2, 2, 0.5, id="swapped"),
    pytest.param(
        [RIGHT, RIGHT, (5, 5, 5, 5, 2, 2), (5, 5, 5, 5, 2, 2)], (1 / 2 + 1) / 2, 1, 7 / 8, id="one switch in the middle"
    ),
    pytest.param([RIGHT, (0,) * 6, RIGHT, RIGHT], 9 / 16, 0, 6 / 8, id="a sweep without labels"),
    pytest.param(
        [RIGHT, (0,) * 6, (5, 5, 5, 5, 2, 2), (5, 5, 5, 5, 2, 2)],
        ((1 / 4 * 1 / 4 + 2 / 4 * 2 / 4) + 9 / 16) / 2, 1, (6 - 1) / 8, id="a switch over a gap",
    ),
    pytest.param([(1,) * 6] * 2, (4 / 6 + 2 / 6) / 2, 0, 0.5, id="two cars as one"),
    # half of the car is no match, and a number that comes and goes unmatched is no switch
    pytest.param(
        [RIGHT, (5, 5, 0, 0, 2, 2), RIGHT], ((8 / 12) ** 2 + (2 / 12) ** 2 + 1) / 2, 0, (5 - 1) / 6, id="half a car"
    ),
    pytest.param([(0,) * 6] * 2, 0.0, 0, 0.0, id="nothing found"),
]  # fmt: skip


@pytest.mark.parametrize(("sweeps", "s_assoc", "switches", "motsa"), CASES)
def test_cases_worked_by_hand(sweeps, s_assoc, switches, motsa):
    total = scored(drive(*sweeps)).total
    assert total.s_assoc == pytest.approx(s_assoc)
    assert (total.id_switches, total.object_frames) == (switches, 2 * len(sweeps))
    assert total.motsa == pytest.approx(motsa)
    assert total.switches_per_100 == pytest.approx(100 * switches / (2 * len(sweeps)))


def test_a_right_prediction_is_exactly_one():
    scores = scored(drive(RIGHT, RIGHT, RIGHT))
    assert (scores.lstq, scores.s_cls, scores.total.s_assoc, scores.total.motsa) == (1.0, 1.0, 1.0, 1.0)


def test_a_class_that_changes_keeps_its_number():
    # the pedestrian of 2 points is called a car once: a miss and an invention, but the tube is whole
    truth = labeling([1, 1, 2, 2], [1, 1, 1, 1])
    right, wrong = labeling([1, 1, 2, 2], [1, 1, 4, 4]), labeling([1, 1, 1, 1], [1, 1, 4, 4])
    scores = scored([(right, truth), (wrong, truth), (right, truth)])
    assert scores.total.s_assoc == 1.0
    assert scores["Pedestrian"].counts == Counts(2, 0, 1)
    assert scores["Car"].counts == Counts(3, 1, 0)
    assert (scores.total.id_switches, scores.total.motsa) == (0, (5 - 1) / 6)
    assert scores.s_cls == pytest.approx((6 / 8 + 4 / 6) / 2)


@pytest.mark.parametrize(("classes", "counts"), [(("Car", "Pedestrian"), (5, 0, 5)), (("car", "truck"), (5, 5, 5))])
def test_a_number_goes_on_through_classes_that_are_not_scored(classes, counts):
    names = ("background", "car", "truck", "road")
    truth = labeling([1] * 50 + [3] * 50, [7] * 50 + [0] * 50, names=names)
    numbers = [7] * 45 + [0] * 55  # the last five points of the car are missed
    sweeps = [labeling([1 + at % 2] * 50 + [3] * 50, numbers, names=names) for at in range(10)]
    pairs = [(f"{at}", prediction, truth) for at, prediction in enumerate(sweeps)]
    tracking = evaluate(pairs, classes=ClassSet.kitti(classes), track=True).tracking
    car = np.tile(truth.instances == 7, 10)
    tube = np.concatenate([prediction.instances == 7 for prediction in sweeps])
    common = np.sum(car & tube)
    assert tracking.total.s_assoc == pytest.approx(common / np.sum(car) * common / np.sum(car | tube))
    # a match is one of its class
    assert (tracking.total.tubes, tracking.total.counts) == (1, Counts(*counts))


def test_numbers_of_the_background_of_a_prediction_are_none():
    truth = labeling([1, 1, 0, 0], [7, 7, 0, 0])
    prediction = labeling([1, 1, 0, 0], [7, 7, 7, 7])
    assert evaluate([("0", prediction, truth)], classes=ClassSet.kitti(), track=True).tracking.total.s_assoc == 1.0


def test_equal_numbers_of_two_classes_are_two_true_objects_and_one_predicted():
    truth = labeling([1, 1, 2, 2], [1, 1, 1, 1])
    assert scored([(truth, truth)]).total.s_assoc == 0.5
    assert scored([(labeling([1, 1, 2, 2], [1, 1, 2, 2]), truth)]).total.s_assoc == 1.0


def test_background_and_ignored_points_have_no_tube():
    # the number of a true point of the background means nothing; a predicted tube has its points where truth has it
    truth = labeling([1, 1, 0, 0, 0], [1, 1, 9, 9, 9], ignored=[4])
    assert scored([(labeling([1, 1, 0, 0, 1], [3, 3, 0, 0, 3]), truth)]).total.s_assoc == 1.0
    assert scored([(labeling([1, 1, 1, 1, 1], [3, 3, 3, 3, 3]), truth)]).total.s_assoc == 0.5
    assert scored([(labeling([1, 1, 1, 1, 1], [3, 3, 3, 3, 3], ignored=[2, 3]), truth)]).total.s_assoc == 1.0


def test_small_objects_are_left_out_sweep_by_sweep():
    near, far = labeling([1] * 4, [1] * 4), labeling([1, 1, 0, 0], [1, 1, 0, 0])
    renamed = labeling([1, 1, 0, 0], [2, 2, 0, 0])
    sweeps = [(near, near), (renamed, far), (near, near)]
    total = scored(sweeps, minimum_points=3).total
    assert (total.s_assoc, total.object_frames, total.id_switches, total.motsa) == (1.0, 2, 0, 1.0)
    assert scored(sweeps, minimum_points=2).total.id_switches == 2
    assert scored(sweeps, minimum_points=5).lstq is None


def test_without_objects_there_is_no_score():
    scores = TrackingScores(NAMES)
    total = scores.total
    assert (scores.lstq, total.s_assoc, scores.s_cls, total.motsa, total.switches_per_100) == (None,) * 5
    scores.add(labeling([1], [1]), labeling([0]))
    assert (scores.lstq, scores.total.s_assoc, scores.s_cls, scores.total.motsa) == (None, None, 0.0, None)
    assert scores.total.counts == Counts(fp=1)


def test_drives_merge_and_their_objects_are_others():
    one, two = scored(drive(RIGHT, RIGHT)), scored(drive((5, 5, 5, 5, 6, 6), (7, 7, 7, 7, 8, 8)))
    one.merge(two)
    # two cars wholly, two by half; the number 1 of one drive is not followed into the other
    total = one.total
    assert (total.s_assoc, total.id_switches, total.object_frames, total.tubes) == (0.75, 2, 8, 4)
    assert total.motsa == (8 - 2) / 8
    one.add(*drive(RIGHT)[0])
    assert (one.total.s_assoc, one.total.id_switches) == (0.75, 2)
    with pytest.raises(ParameterError, match="minimum points"):
        one.merge(TrackingScores(NAMES, minimum_points=50))
    with pytest.raises(ParameterError, match="other classes"):
        one.merge(TrackingScores(("Car",)))


def test_labels_must_be_of_these_classes():
    with pytest.raises(ParameterError, match="map it to them first"):
        TrackingScores(("Bus",)).add(labeling([1], [1]), labeling([1], [1]))
    with pytest.raises(KeyError):
        TrackingScores(NAMES)["Bus"]


def test_memory_does_not_grow_with_the_sweeps():
    few, many = (pickle.dumps(scored(drive(*[RIGHT] * n))) for n in (10, 1000))
    assert len(many) < len(few) + 100


def test_evaluate_tracks_by_the_numbers_of_the_files():
    # two names that become one class and share a number are numbered anew in their frame, but not for the drive
    truth = labeling([1, 1, 1, 1], [5, 5, 5, 5], names=("background", "car"))
    names = ("background", "car", "moving-car")
    sweeps = [labeling([1, 1, 1, 1], [5] * 4, names=names), labeling([1, 1, 1, 2], [5] * 4, names=names)]
    pairs = [(f"{n}", prediction, truth) for n, prediction in enumerate(sweeps)]
    tracking = evaluate(pairs, classes=ClassSet.kitti(), track=True).tracking
    total = tracking.total
    assert (total.id_switches, total.s_assoc, total.object_frames) == (0, 1.0, 2)
    assert evaluate(pairs, classes=ClassSet.kitti()).tracking is None
    assert evaluate(pairs, classes=ClassSet.kitti(), minimum_points=5, track=True).tracking.total.object_frames == 0
