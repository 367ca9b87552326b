"""Numbers of objects over a drive."""

from dataclasses import replace

import numpy as np
import pytest

import ldls
from conftest import pinhole
from ldls.sequences.moment import Boxes, Moment
from ldls.sequences.propagation import BELOW_M, CONFIDENCE, ENOUGH_IMAGES, FEW_IMAGES, NEAR_M, mistaken, overlooked
from ldls.sequences.track import MEMORY_S, Footprint, Sighting, Track
from ldls.sequences.tracker import TWO_LABELS, TWO_OBJECTS
from ldls.simulation import Drive, SegmenterErrors, SensorErrors, drive_frame

WIDE = pinhole(100.0, (320.0, 240.0), T_camera_lidar=[[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
PARAMS = replace(ldls.Params.paper(), iterations=2)


def box_of_points(x, y, *, size=0.6):
    steps = np.linspace(-size / 2, size / 2, 5)
    return np.stack(np.meshgrid(x + steps, y + steps, steps), axis=-1).reshape(-1, 3)


def sweep_at(stamp, objects, *, order=None, pose=None, category=1, names=None):
    """A sweep of objects at (x, y) in the world, its masks in any order; None is one that the segmenter misses."""
    pose = np.eye(4) if pose is None else pose
    back = np.linalg.inv(pose)
    clouds = [box_of_points(*place) @ back[:3, :3].T + back[:3, 3] for place, _ in objects]
    pixels = []
    for cloud, (_, seen) in zip(clouds, objects, strict=True):
        _, uv = ldls.stages.project(cloud, WIDE, image_size=(480, 640))
        mask = np.zeros((480, 640), bool)
        if seen and len(uv):
            (left, top), (right, bottom) = uv.min(axis=0).astype(int) - 1, uv.max(axis=0).astype(int) + 2
            mask[top:bottom, left:right] = True
            pixels.append(mask)
    pixels = [pixels[number] for number in order or range(len(pixels))]
    pixels = np.array(pixels).reshape(-1, 480, 640)
    masks = ldls.InstanceMasks.from_array(pixels, categories=[category] * len(pixels), names=names)
    return ldls.Sweep(np.concatenate(clouds), [ldls.View(masks, WIDE)], pose, stamp)


def tracks_of(tracker, sweeps, *, together=1, params=PARAMS):
    """Tracks of each sweep by the object whose points they are on; 0 for none."""
    rows = []
    for start in range(0, len(sweeps), together):
        window = sweeps[start : start + together]
        for sweep, result in zip(
            window, tracker.track(window, ldls.segment_sweeps(window, params=params)), strict=True
        ):
            numbers = np.array([0, *(instance.track for instance in result.instances)])
            per_object = np.maximum(result.labels, 0).reshape(-1, 125)
            assert sweep.points is result.points
            rows.append([int(np.bincount(numbers[labels]).argmax()) for labels in per_object])
    return rows


def test_masks_in_any_order_are_the_same_objects():
    places = [((6, -2), True), ((6, 0), True), ((7, 2), True)]
    orders = [(0, 1, 2), (2, 1, 0), (1, 2, 0), (2, 0, 1)]
    sweeps = [sweep_at(0.1 * k, places, order=order) for k, order in enumerate(orders)]
    for together in (1, 2, 4):
        rows = tracks_of(ldls.Tracker(), sweeps, together=together)
        assert len(set(rows[0])) == 3
        assert all(row == rows[0] for row in rows), together


def test_an_object_is_itself_after_a_second_without_a_mask_though_it_moves():
    def places(k):
        return [((6, -2), not 4 <= k < 14), ((6 + 0.8 * k * 0.1, 1 + 0.5 * k * 0.1), not 8 <= k < 18)]

    sweeps = [sweep_at(0.1 * k, places(k)) for k in range(25)]
    rows = np.array(tracks_of(ldls.Tracker(), sweeps))
    assert [sorted(set(column) - {0}) for column in rows.T] == [[1], [2]]
    assert rows[6, 0] == 0 and rows[10].tolist() == [1, 2]


def test_an_object_too_fast_for_one_label_is_itself_by_one_after_the_other():
    # masks of two moments have no points in common
    sweeps = [sweep_at(0.1 * k, [((8, -4 + 1.2 * k), True), ((8, 6), True)]) for k in range(8)]
    labels = {tuple(result.labels[:125]) for result in ldls.segment_sweeps(sweeps[:4], params=PARAMS)}
    assert len(labels) == 4
    rows = np.array(tracks_of(ldls.Tracker(), sweeps, together=4))
    assert [len(set(column)) for column in rows.T] == [1, 1] and rows[0, 0] != rows[0, 1]


def test_velocities_are_those_of_the_world():
    tracker, speed = ldls.Tracker(), 1.2
    for k in range(12):
        pose = np.eye(4)
        pose[0, 3] = 0.3 * k
        sweep = sweep_at(0.1 * k, [((8, -2), True), ((9, 1 + speed * 0.1 * k), True)], pose=pose)
        (result,) = tracker.track([sweep], ldls.segment_sweeps([sweep], params=PARAMS))
    standing, walking = sorted((instance.velocity for instance in result.instances), key=np.linalg.norm)
    assert standing == (0, 0)
    assert walking == pytest.approx((0, speed), abs=0.1)


def test_what_stands_has_no_velocity_though_more_of_it_is_seen_in_each_sweep():
    """The side of a lorry, as it comes out from behind a house: the middle of what is visible of it moves."""
    tracker = ldls.Tracker()
    for k in range(20):
        sweep = sweep_at(0.1 * k, [((8, -2 + 0.2 * part), True) for part in range(k + 1)])
        mask = ldls.InstanceMasks.from_array(sweep.views[0].masks.to_array().any(axis=0)[None], categories=[1])
        sweep = replace(sweep, views=[ldls.View(mask, WIDE)])
        (result,) = tracker.track([sweep], ldls.segment_sweeps([sweep], params=PARAMS))
        assert (result.labels == 1).mean() > 0.9
        assert result.instances[0].track == 1 and result.instances[0].velocity == (0, 0)


def test_a_turn_of_the_lidar_moves_no_object():
    places = [((6, -1.5), True), ((6.5, 1.5), True)]
    sweeps = []
    for k in range(6):
        angle = 0.05 * k
        c, s = np.cos(angle), np.sin(angle)
        pose = np.array([[c, -s, 0, 0.1 * k], [s, c, 0, -0.05 * k], [0, 0, 1, 0.0], [0, 0, 0, 1]])
        sweeps.append(sweep_at(0.1 * k, places, pose=pose))
    assert tracks_of(ldls.Tracker(), sweeps) == [[1, 2]] * 6


def test_two_who_meet_do_not_swap():
    def places(k):
        return [((6, -1 + 0.12 * k), True), ((7.2, 1 - 0.12 * k), True)]

    sweeps = [sweep_at(0.1 * k, places(k), order=(0, 1) if k % 2 else (1, 0)) for k in range(16)]
    rows = np.array(tracks_of(ldls.Tracker(), sweeps))
    # one hides the other for a moment
    assert [len(set(column) - {0}) for column in rows.T] == [1, 1]
    assert (rows == 0).sum() <= 1
    assert rows[0, 0] != rows[0, 1]


LEFT, RIGHT = (0, 1), (3, 4)


def car_at(k, y, *shown, ends_m=(0.6, 1.2)):
    """A sweep of a car 3 m long and `y` m to the left, in five parts, and of masks of some of them each."""
    near, far = ends_m
    whole = sweep_at(0.1 * k, [((8, y + part), True) for part in (-far, -near, 0, near, far)])
    pixels = whole.views[0].masks.to_array()
    masks = np.array([pixels[list(parts)].any(axis=0) for parts in shown]).reshape(-1, 480, 640)
    return replace(whole, views=[ldls.View(ldls.InstanceMasks.from_array(masks, categories=[1] * len(shown)), WIDE)])


@pytest.mark.parametrize("ends_m", [(0.6, 1.2), (1.8, 2.4)], ids=["a car", "two cars"])
def test_tracks_of_one_object_are_joined(ends_m):
    """The masks of the first sweeps show the two ends of a car as two objects."""

    def sweep(k, *shown):
        return car_at(k, 0, *shown, ends_m=ends_m)

    sweeps = [sweep(0, LEFT), sweep(1, LEFT, RIGHT), sweep(2, LEFT, RIGHT)]
    one = ends_m == (0.6, 1.2)
    sweeps += [sweep(3, (*LEFT, 2, *RIGHT)) if one else sweep(3, LEFT)]
    rows = tracks_of(ldls.Tracker(), [*sweeps, sweep(4, RIGHT), sweep(5, LEFT)])
    assert [rows[2][0], rows[2][4]] == [1, 2]
    assert rows[4][4] == (1 if one else 2)
    assert rows[5][0] == 1


def test_what_stands_is_not_one_object_with_what_would_have_come_by():
    """A walker whom images showed more often is overlooked, and stops before the way that he went reaches the other."""

    def places(k):
        return [((8, -2.0 + 0.2 * min(k, 11)), k < 10), ((8, 1), k >= 8)]

    rows = np.array(tracks_of(ldls.Tracker(), [sweep_at(0.1 * k, places(k)) for k in range(20)]))
    assert set(rows[:10, 0]) == {1} and set(rows[8:, 1]) == {2}


@pytest.mark.parametrize(("sweeps_apart", "numbers"), [(TWO_OBJECTS - 1, {1}), (TWO_OBJECTS, {1, 2})])
def test_tracks_that_images_show_apart_are_two_objects_though_one_mask_shows_both(sweeps_apart, numbers):
    masks = [*([LEFT, RIGHT] for _ in range(sweeps_apart)), [(*LEFT, 2, *RIGHT)], [LEFT, RIGHT]]
    rows = tracks_of(ldls.Tracker(), [car_at(k, 0, *parts) for k, parts in enumerate(masks)])
    assert rows[0][::4] == [1, 2]
    assert set(rows[-1][::4]) == numbers


def test_tracks_joined_within_a_window_have_one_number_in_all_of_it():
    """A car passes too fast to have one label; an end of it is seen alone, then all of it."""
    shown = {0: [LEFT], **dict.fromkeys((1, 2, 3), (LEFT, RIGHT)), 4: [RIGHT], 8: [(*LEFT, 2, *RIGHT)]}
    sweeps = [car_at(k, k - 6, *parts) for k, parts in shown.items()]
    tracker = ldls.Tracker()
    alone, together = tracks_of(tracker, sweeps[:4]), tracks_of(tracker, sweeps[4:], together=2)
    assert alone[3] == [1, 1, 1, 2, 2]
    assert together == [[1] * 5] * 2


def test_an_object_goes_on_as_what_it_is_near_in_all_sweeps_of_a_call():
    """In the first of four sweeps one that drives off is nearer to where the other stood."""
    tracker = ldls.Tracker()
    tracks_of(tracker, [sweep_at(0.1 * k, [((8, 0), True)]) for k in range(3)])
    places = [((8, 0 if k else 0.5), (8, -0.4 - 0.8 * k)) for k in range(4)]
    sweeps = [sweep_at(0.3 + 0.1 * k, [(stands, True), (drives, True)]) for k, (stands, drives) in enumerate(places)]
    labels = np.repeat(np.array([1, 2], np.int32), 125)
    results = [replace(ldls.segment_sweeps([sweep], params=PARAMS)[0], labels=labels) for sweep in sweeps]
    assert tracker.track(sweeps, results)[0].instance_ids[1:].tolist() == [1, 2]


def test_objects_that_stand_keep_their_numbers_where_one_label_is_of_both():
    apart = [car_at(k, 0, LEFT, RIGHT, ends_m=(1.8, 2.4)) for k in range(3)]
    sweeps = [*apart, *(car_at(k, 0, (*LEFT, *RIGHT), ends_m=(1.8, 2.4)) for k in (3, 4))]
    for together in (1, 3):
        rows = tracks_of(ldls.Tracker(), sweeps, together=together, params=replace(PARAMS, remove_outliers=False))
        assert [[row[part] for part in (*LEFT, *RIGHT)] for row in rows] == [[1, 1, 2, 2]] * 5


def test_an_object_that_begins_keeps_its_points_where_another_was():
    (result,) = ldls.segment_sweeps([sweep_at(0.0, [((8, 0), True)])], params=PARAMS)
    tracks = [Track(number, result.instances[0]) for number in (1, 2)]
    points = box_of_points(8, 0)

    def moment(stamp, number, other=None):
        numbers = np.full(len(points), number)
        numbers[-1] = other or number
        return Moment(stamp, points, numbers, np.arange(len(points)), blind=False)

    assert not mistaken([moment(0.1, 2)], [moment(0.0, 1)], tracks)[0].any()
    # with a point of its own before it is known, and outvoted
    assert set(mistaken([moment(0.1, 2)], [moment(0.0, 1, other=2)], tracks)[0].tolist()) >= {1}


@pytest.mark.parametrize("moves", [1, 2])
def test_a_point_of_what_passes_is_of_what_stands_there_and_not_the_other_way_round(moves):
    (result,) = ldls.segment_sweeps([sweep_at(0.0, [((8, 0), True)])], params=PARAMS)
    tracks = [Track(number, result.instances[0]) for number in (1, 2)]
    tracks[moves - 1].velocity = np.array([0.0, 5.0])
    points = box_of_points(8, 0)
    rows = np.arange(len(points))
    before = Moment(0.0, points, np.where(rows < 5, 2, 1), rows, blind=False)
    now = Moment(0.1, points, np.full(len(points), 2), rows, blind=False)
    (found,) = mistaken([now], [before], tracks)
    assert np.mean(found == 1) > 0.8 if moves == 2 else not found.any()


def test_a_second_label_in_the_place_of_an_object_is_the_object():
    """In the second of three sweeps the even parts of a car have another label than the odd ones."""
    sweeps = [car_at(k, 0, (*LEFT, 2, *RIGHT)) for k in range(3)]
    results = []
    for k, result in enumerate(ldls.segment_sweeps(sweeps, params=PARAMS)):
        labels = result.labels.reshape(-1, 125).copy()
        labels[::2] = 1 + (k == 1)
        second = replace(result.instances[0], label=2)
        results.append(replace(result, labels=labels.ravel(), instances=(*result.instances, second)))
    for result, before in zip(ldls.Tracker().track(sweeps, results), results, strict=True):
        assert result.instance_ids[1:].tolist() == [1, 1]
        np.testing.assert_array_equal(result.labels, np.minimum(before.labels, 1))


@pytest.mark.parametrize(
    ("beside_m", "n_before", "n_sweeps", "numbers"),
    [
        (None, 2, 1, {1}),
        (3.0, 2, 1, {1}),
        (1.5, 2, 1, {1}),
        (1.5, TWO_OBJECTS, 1, {1, 2}),
        (None, 2, TWO_LABELS, {1, 2}),
    ],
    ids=["alone", "beside another", "near another", "near one shown apart from it", "two that are shown apart"],
)
def test_labels_that_begin_together_in_the_place_of_an_object_are_the_object(beside_m, n_before, n_sweeps, numbers):
    """Every other point of an object has another label, where images overlook what stood beside it."""
    tracker = ldls.Tracker()
    places = [((8, y), True) for y in (0, beside_m) if y is not None]
    tracks_of(tracker, [sweep_at(0.1 * k, places) for k in range(n_before)])
    sweeps = [sweep_at(0.1 * (n_before + k), [((8, 0), True)]) for k in range(n_sweeps)]
    results = []
    for result in ldls.segment_sweeps(sweeps, params=PARAMS):
        labels = np.where(np.arange(125) % 2, 2, 1).astype(np.int32)
        instances = (*result.instances, replace(result.instances[0], label=2))
        results.append(replace(result, labels=labels, instances=instances))
    for tracked in tracker.track(sweeps, results):
        assert set(tracked.instance_ids[1:].tolist()) == numbers


def test_a_second_label_beside_an_object_is_another():
    sweeps = [sweep_at(0.1 * k, [((8, 0), True), ((8, 1.2), k == 1)]) for k in range(3)]
    assert tracks_of(ldls.Tracker(), sweeps, together=3)[1] == [1, 2]


def lorry_with_a_second_label(shows):
    """Sweeps of a lorry, and results in which three points at one end have another label where `shows` says so."""
    lorry = [((8, 0.2 * part), True) for part in range(-15, 16)]
    sweeps = [sweep_at(0.1 * k, lorry) for k in range(len(shows))]
    results = []
    for sweep, shown in zip(sweeps, shows, strict=True):
        (result,) = ldls.segment_sweeps([sweep], params=PARAMS)
        labels = np.where(result.labels > 0, 1, result.labels)
        labels[:3] = 1 + shown
        results.append(replace(result, labels=labels, instances=result.instances[:2]))
    return sweeps, results


def test_a_few_points_on_an_object_are_of_it_within_sweeps_of_one_call():
    sweeps, results = lorry_with_a_second_label([False, True, False])
    for result in ldls.Tracker().track(sweeps, results):
        assert result.instance_ids[1:].tolist() == [1, 1]
        assert set(result.labels.tolist()) == {1}


def test_a_few_points_on_an_object_may_be_another_in_sweeps_apart():
    tracker = ldls.Tracker()
    for sweep, result in zip(*lorry_with_a_second_label([False, True, False, True]), strict=True):
        (tracked,) = tracker.track([sweep], [result])
    assert tracked.instance_ids[1:].tolist() == [1, 2]


@pytest.mark.parametrize(
    ("apart", "beside_lorry", "numbers"),
    [
        (1.2, True, [2, 2]),
        (1.2, False, [1, 2]),
        (3.9, True, [2, 2]),
        (3.9, False, [1, 2]),
        (4.9, True, [2, 3]),
    ],
)
def test_single_points_are_one_object_where_others_of_its_category_are_long(apart, beside_lorry, numbers):
    lorry = [((8, 0.2 * part), True) for part in range(-15, 16)]
    sweeps = [sweep_at(0.1 * k, [*lorry, ((14, 0), True), ((14, apart), True)]) for k in range(3)]
    results = []
    for k, sweep in enumerate(sweeps):
        (result,) = ldls.segment_sweeps([sweep], params=PARAMS)
        distances = np.linalg.norm(result.points[:, :2] - (14, apart * (k == 1)), axis=1)
        labels = np.where((result.labels > 0) & (result.points[:, 0] < 9) & beside_lorry, 1, 0)
        labels[distances.argmin()] = 3 if k == 1 else 2
        results.append(replace(result, labels=labels.astype(np.int32), instances=result.instances[:3]))
    for result in ldls.Tracker().track(sweeps, results):
        assert result.instance_ids[2:].tolist() == numbers


def test_what_stands_has_no_velocity_though_another_end_is_seen_soon():
    """One end of a car, soon the other, and a point of it last."""
    end = np.stack(np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1.6, 3)), axis=-1).reshape(-1, 2)
    track = Track(1, ldls.Instance(label=1, category=3, name="car", score=1.0, sources=()))
    for k in range(21):
        points = end + np.array([3, 0]) if k < 4 else end if k < 20 else end[:1]
        track.advance(track.instance, Sighting(0.1 * k, Footprint(points), shown=True))
    assert track.velocity.tolist() == [0, 0]


def test_what_stands_has_no_velocity_though_few_of_its_points_are_seen_in_the_last_sweeps():
    whole = np.stack(np.meshgrid(np.linspace(0, 4, 5), np.linspace(0, 1.6, 4)), axis=-1).reshape(-1, 2)
    track = Track(1, ldls.Instance(label=1, category=3, name="car", score=1.0, sources=()))
    for k in range(20):
        points = whole if k < 15 else whole[-1:] + 0.5
        track.advance(track.instance, Sighting(0.1 * k, Footprint(points), shown=True))
    assert track.velocity.tolist() == [0, 0]


def test_boxes_hold_the_points_within_them():
    generator = np.random.default_rng(3)
    points = generator.uniform(0, 10, (400, 3)).round(1)
    points = points[np.argsort(points[:, 0])]
    low = generator.uniform(0, 8, (9, 3)).round(1)
    boxes = Boxes(np.arange(9), low, low + 3)
    expected = [np.flatnonzero(np.all((points >= one) & (points <= one + 3), axis=1)) for one in low]
    assert [held.tolist() for held in boxes.hold(points)] == [each.tolist() for each in expected]


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (6.0, -3.0)])
def test_overlooked_points_are_those_nearest_to_an_object_where_it_has_gone(velocity):
    generator = np.random.default_rng(5)

    def moment(stamp, of_track):
        points = generator.uniform((0, 0, 0), (12, 6, 1), (500, 3))
        points = points[np.argsort(points[:, 0])]
        tracks = np.where(points[:, 0] < 6, 1, 2) * (points[:, 1] > 3) * of_track
        return Moment(stamp, points, tracks, np.arange(len(points)), blind=False)

    now, there = moment(0.1, of_track=0), moment(0.0, of_track=1)
    instance = ldls.Instance(label=1, category=3, name="car", score=1.0, sources=())
    tracks = [Track(number, instance, n_images=ENOUGH_IMAGES) for number in (1, 2)]
    for track, its in zip(tracks, ((0.0, 0.0), velocity), strict=True):
        track.velocity = np.array(its)
    gone = there.points + 0.1 * np.where(there.tracks == 2, 1, 0)[:, None] * (*velocity, 0)
    distances = np.linalg.norm(now.points[:, None] - gone, axis=2)
    expected = np.where(distances.min(axis=1) < NEAR_M, there.tracks[distances.argmin(axis=1)], 0)
    lowest = {number: there.points[there.tracks == number, 2].min() - BELOW_M for number in (1, 2)}
    expected = [
        number if number and z >= lowest[number] else 0 for number, z in zip(expected, now.points[:, 2], strict=True)
    ]
    assert set(expected) == {0, 1, 2}
    assert overlooked(now, [there, now], tracks).tolist() == expected


@pytest.mark.parametrize("clock", [0.0, 0.3, 1.03, 1767700800.3])
@pytest.mark.parametrize("period", [0.1, 1 / 3])
def test_of_two_moments_as_near_the_earlier_says_what_was_overlooked_whatever_rounding_does(period, clock):
    instance = ldls.Instance(label=1, category=3, name="car", score=1.0, sources=())
    track = Track(1, instance, n_images=ENOUGH_IMAGES)
    track.velocity = np.zeros(2)
    for k in range(20):
        before, stamp, after = (round(period * at + clock, 6) for at in (k, k + 1, k + 2))
        # the object is seen at one end, then at the other
        ends = np.array([[0.0, 0, 0], [1.0, 0, 0]])
        there = [
            Moment(before, ends, np.array([1, 0]), np.arange(2), blind=False),
            Moment(after, ends, np.array([0, 1]), np.arange(2), blind=False),
        ]
        now = Moment(stamp, np.array([[0.1, 0, 0], [0.9, 0, 0]]), np.zeros(2, np.int64), np.arange(2), blind=False)
        assert overlooked(now, [there[0], now, there[1]], [track]).tolist() == [1, 0]


def test_images_are_those_of_sweeps_however_many_labels_an_object_has_there():
    instance = ldls.Instance(label=1, category=3, name="car", score=1.0, sources=())
    track, footprint = Track(1, instance), Footprint(np.zeros((1, 2)))
    for stamp, shown in ((0.0, True), (0.1, False), (0.1, True), (0.1, True), (0.2, False)):
        track.advance(instance, Sighting(stamp, footprint, shown))
    assert track.n_images == 2


def test_what_has_gone_away_leaves_no_label_where_it_was():
    instance = ldls.Instance(label=1, category=3, name="car", score=1.0, sources=())
    stands, moves = (Track(number, instance, n_images=ENOUGH_IMAGES) for number in (1, 2))
    stands.velocity, moves.velocity = np.zeros(2), np.array([30.0, 0.0])
    there = Moment(0.0, np.array([[0.0, 0, 0], [0.7, 0, 0]]), np.array([1, 2]), np.arange(2), blind=False)
    now = Moment(0.1, np.array([[0.1, 0, 0], [0.6, 0, 0]]), np.zeros(2, np.int64), np.arange(2), blind=False)
    assert overlooked(now, [there, now], [stands, moves]).tolist() == [1, 0]


def test_a_number_is_given_once_and_not_across_categories_or_long_gaps():
    tracker = ldls.Tracker()
    place = [((6, 0), True)]
    stamps_and_categories = [(0.0, 1), (0.1, 3), (0.2, 1), (10.1, 1), (20.3, 1)]
    rows = [tracks_of(tracker, [sweep_at(stamp, place, category=kind)]) for stamp, kind in stamps_and_categories]
    assert rows == [[[1]], [[2]], [[1]], [[1]], [[3]]]


def test_an_object_goes_by_the_name_of_its_class_where_masks_number_each_in_their_own_way():
    place = [((6, 0), True)]
    named = [(100, "cone"), (101, "Cone"), (100, "barrel"), (100, "cone")]
    sweeps = [sweep_at(0.1 * k, place, category=one, names={one: name}) for k, (one, name) in enumerate(named)]
    assert tracks_of(ldls.Tracker(), sweeps) == [[1], [1], [2], [1]]
    tracker, stream = ldls.Tracker(), ldls.LabelDiffusion(params=PARAMS, before=0)
    for sweep, known in zip(sweeps, [(100, "cone"), (100, "cone"), (101, "barrel"), (100, "cone")], strict=True):
        (result,) = tracker.track([sweep], ldls.segment_sweeps([sweep], params=PARAMS))
        streamed = stream.segment(sweep.points, sweep.views, pose=sweep.pose, stamp=sweep.stamp)
        for (instance,) in (result.instances, streamed.instances):
            assert (instance.category, instance.name) == known


def test_sweeps_of_a_call_may_be_farther_apart_than_tracks_live():
    sweeps = [sweep_at(stamp, [((6, 0), True)]) for stamp in (0.0, 0.1, 0.2, 30.0)]
    assert tracks_of(ldls.Tracker(), sweeps, together=2) == [[1]] * 4


def test_sweeps_without_objects_change_nothing():
    tracker = ldls.Tracker()
    seen, empty = [((6, 0), True)], [((6, 0), False)]
    rows = tracks_of(tracker, [sweep_at(0.1 * k, empty if k % 2 else seen) for k in range(4)])
    assert rows == [[1], [0], [1], [0]]
    (result,) = tracker.track([sweep_at(0.5, [((6, 0), False)])], ldls.segment_sweeps([sweep_at(0.5, empty)]))
    assert result.instances == ()


@pytest.mark.parametrize("together", [1, 2, 5])
def test_an_overlooked_object_has_its_label_of_the_nearest_moment(together):
    """One stands and one walks towards something that never has a mask; in the end some images have none at all."""
    shown = [k < ENOUGH_IMAGES or k % 3 == 2 for k in range(ENOUGH_IMAGES + 8)]
    sweeps = [
        sweep_at(0.1 * k, [((6, -2), seen), ((7, -0.5 + 0.12 * k), seen), ((7, 3.2), False)])
        for k, seen in enumerate(shown)
    ]
    tracker, results = ldls.Tracker(), []
    for start in range(0, len(sweeps), together):
        some = sweeps[start : start + together]
        results += tracker.track(some, ldls.segment_sweeps(some, params=PARAMS))
    for seen, result in zip(shown, results, strict=True):
        assert all(instance.label == at for at, instance in enumerate(result.instances, start=1))
        numbers = np.array([0, *(instance.track for instance in result.instances)])
        of_standing, of_walking, of_rest = numbers[np.maximum(result.labels, 0)].reshape(-1, 125)
        assert np.mean(of_standing == 1) > 0.7 and set(of_standing) <= {0, 1}
        assert np.mean(of_walking == 2) > 0.7 and set(of_walking) <= {0, 2}
        assert np.mean(of_rest == 0) > 0.9
        if not seen and together == 1:
            assert np.all(result.confidence[result.labels > 0] == np.float32(CONFIDENCE))
            assert [thing.n_points > 100 for thing in result.objects] == [True, True]
            with pytest.raises(ldls.InputError, match="label 1 from another sweep, by the tracker"):
                ldls.explain(result, int(np.argmax(result.labels == 1)))


@pytest.mark.parametrize(("abstain", "given"), [(0.8, True), (0.9, False)])
def test_an_overlooked_object_has_no_label_where_one_must_be_surer(abstain, given):
    params = replace(PARAMS, calibrated=True, abstain=abstain)
    tracker = ldls.Tracker()
    for k in range(ENOUGH_IMAGES + 1):
        sweep = sweep_at(0.1 * k, [((6, -2), k < ENOUGH_IMAGES), ((6, 2), True)])
        (result,) = tracker.track([sweep], ldls.segment_sweeps([sweep], params=params))
    overlooked, shown = result.labels.reshape(-1, 125)
    assert np.any(shown > 0) and np.any(overlooked > 0) == given
    assert len(result.instances) == 1 + given
    assert not np.any(result.abstained & (result.labels > 0))


def test_an_object_has_all_of_its_points_after_a_mask_of_a_part_of_it():
    whole, part = (*LEFT, 2, *RIGHT), LEFT
    sweeps = [car_at(k, 0, whole) for k in range(ENOUGH_IMAGES)]
    sweeps += [car_at(ENOUGH_IMAGES, 0, part), car_at(ENOUGH_IMAGES + 1, 0)]
    assert tracks_of(ldls.Tracker(), sweeps) == [[1] * 5] * len(sweeps)


@pytest.mark.parametrize("blind", [True, False])
def test_what_few_images_showed_or_none_for_long_has_no_label_where_it_has_no_mask(blind):
    count = FEW_IMAGES if blind else ENOUGH_IMAGES
    beside = [] if blind else [((6, 3), True)]
    often, seldom = ([sweep_at(0.1 * k, [((6, 0), True), *beside]) for k in range(n)] for n in (count, count - 1))
    soon, late = (0.1 * (count - 1) + after for after in (MEMORY_S - 0.05, MEMORY_S + 0.05))
    gone = [((6, 0), False), *beside]
    assert tracks_of(ldls.Tracker(), [*often, sweep_at(soon, gone)])[-1][0] == 1
    assert tracks_of(ldls.Tracker(), [*often, sweep_at(late, gone)])[-1][0] == 0
    assert tracks_of(ldls.Tracker(), [*seldom, sweep_at(soon, gone)])[-1][0] == 0


def test_times_of_the_tracker_do_not_hang_on_rounding():
    place = [((6, 0), True)]
    # 4.4 - 2.4 is more than MEMORY_S, and 16.1 - 6.1 more than the time after which tracks end
    sweeps = [sweep_at(2.4 - 0.1 * k, place) for k in reversed(range(FEW_IMAGES))]
    assert tracks_of(ldls.Tracker(), [*sweeps, sweep_at(4.4, [((6, 0), False)])])[-1] == [1]
    assert tracks_of(ldls.Tracker(), [sweep_at(stamp, place) for stamp in (6.1, 16.1)]) == [[1], [1]]


def test_memory_is_that_of_the_last_seconds():
    tracker = ldls.Tracker()
    for k in range(30):
        sweep = sweep_at(float(k), [((6 + 3 * (k % 2), -2 + 4 * (k // 2 % 2)), True)])
        tracker.track([sweep], ldls.segment_sweeps([sweep], params=PARAMS))
    assert len(tracker._tracks) <= 4


def test_tracks_are_kept_in_files(tmp_path):
    sweep = sweep_at(0.0, [((6, 0), True)])
    (result,) = ldls.Tracker().track([sweep], ldls.segment_sweeps([sweep], params=PARAMS))
    changed = (replace(instance, track=77, velocity=(1.5, -0.25)) for instance in result.instances)
    result = replace(result, instances=tuple(changed))
    ldls.save(result, tmp_path / "a.npz")
    assert ldls.read_result(tmp_path / "a.npz").instances == result.instances
    ldls.save(result, tmp_path / "a.label")
    assert set(np.fromfile(tmp_path / "a.label", "<u4") >> 16) == {77}
    many = replace(result, instances=(replace(result.instances[0], track=65_536),))
    with pytest.raises(ldls.LimitError, match="16 bits for the number of an instance, got 65536"):
        ldls.save(many, tmp_path / "b.label")
    assert not (tmp_path / "b.label").exists()


def test_misuse_is_named():
    sweep = sweep_at(0.5, [((6, 0), True)])
    results = ldls.segment_sweeps([sweep], params=PARAMS)
    tracker = ldls.Tracker()
    with pytest.raises(ldls.InputError, match="got 0 for 1 sweeps"):
        tracker.track([sweep], [])
    later = sweep_at(0.6, [((6, 0), True)], category=2)
    with pytest.raises(ldls.InputError, match="their instances differ, expected those of one call"):
        tracker.track([sweep, later], [*results, *ldls.segment_sweeps([later], params=PARAMS)])
    with pytest.raises(ldls.ShapeError, match="result: has 125 points, the sweep 250; give its own"):
        tracker.track([sweep_at(0.5, [((6, 0), True), ((6, 2), True)])], results)
    moved = replace(sweep, points=sweep.points + np.float32(0.5))
    for refuses in (tracker.track, ldls.LabelledMap().add):
        given = ([moved], results) if refuses == tracker.track else (moved, results[0])
        with pytest.raises(ldls.InputError, match="result: is of as many other points than those of the sweep"):
            refuses(*given)
    tracker.track([moved], [replace(result, points=moved.points) for result in results])
    tracker = ldls.Tracker()
    tracker.track([replace(sweep, points=sweep.points.copy())], results)
    with pytest.raises(ldls.InputError, match=r"two have the stamp 0\.5 s"):
        tracker.track([sweep], results)


def test_cars_of_a_simulated_drive_keep_their_numbers_though_masks_are_missing():
    drive = Drive(n_frames=6, seed=5, lidar="vlp-16", segmenter=SegmenterErrors.none(), sensors=SensorErrors.none())
    generator, tracker = np.random.default_rng(0), ldls.Tracker()
    frames, results = [drive_frame(drive, number) for number in range(6)], []
    for start in (0, 3):
        sweeps = []
        for frame in frames[start : start + 3]:
            (image,) = frame.images
            found = np.flatnonzero(generator.random(len(image.masks)) < 0.8)
            view = ldls.View(image.masks.select(generator.permutation(found)), image.camera)
            sweeps.append(ldls.Sweep(frame.points, [view], frame.pose, frame.stamp))
        results += tracker.track(sweeps, ldls.segment_sweeps(sweeps))
    numbers = {}
    for frame, result in zip(frames, results, strict=True):
        tracks = np.array([0, *(instance.track for instance in result.instances)])[np.maximum(result.labels, 0)]
        for thing in np.unique(frame.truth.instances[frame.truth.classes == frame.truth.names.index("Car")]):
            own = tracks[(frame.truth.instances == thing) & (result.labels > 0)]
            if len(own) >= 20:
                numbers.setdefault(int(thing), []).append(int(np.bincount(own).argmax()))
    assert sum(len(own) == 6 for own in numbers.values()) >= 1
    assert all(len(set(own)) == 1 for own in numbers.values()), numbers
