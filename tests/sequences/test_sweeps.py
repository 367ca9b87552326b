"""Several sweeps in one graph: against plain double precision, and what each sweep gets back."""

import re
import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ldls
import oracle
from ldls.camera.rigid import from_parts, inverse
from ldls.errors import NothingInView, NoUsablePoints, ScaleWarning, UprightWarning
from ldls.io.labels.kitti_objects import read_kitti_objects
from ring_samples import random_ring

turned = pytest.mark.filterwarnings("ignore::ldls.errors.UprightWarning")
"""Of lidars that were turned over."""
PLAIN = {"neighbors": 6, "sigma": 0.3, "pixel_weight": 0.01, "iterations": 40}


def moments(seed):
    """Points of three moments by turns, and the masks, categories and camera of each moment.

    Every other time it is one camera, which sees all objects at the first moment and some at each of the others.
    """
    points, views = random_ring(seed)
    if seed % 2:
        pixels, _, camera = views[1]
        views = [(pixels[some], None, camera) for some in ([0, 1, 2, 3], [0, 1], [1, 2, 3])]
    points = points[np.random.default_rng(seed).permutation(len(points))]
    # mostly one category, so that objects of several moments abound
    kinds = np.random.default_rng(seed)
    return np.array_split(points, 3), [
        (pixels, 1 + (kinds.random(len(pixels)) < 0.2), camera) for pixels, _, camera in views
    ]


def poses(seed, n=3):
    turns = Rotation.random(n, random_state=seed).as_matrix()
    places = np.random.default_rng(seed).uniform(-2, 2, (n, 3))
    return [from_parts(turn, place) for turn, place in zip(turns, places, strict=True)]


def sweeps_of(seed, *, world_from_lidar=None):
    world_from_lidar = world_from_lidar or [np.eye(4)] * 3
    clouds, views = moments(seed)
    sweeps = []
    for number, (cloud, (pixels, categories, camera)) in enumerate(zip(clouds, views, strict=True)):
        pose = world_from_lidar[number]
        back = inverse(pose)
        masks = ldls.InstanceMasks.from_array(pixels, categories=categories)
        own = replace(camera, T_camera_lidar=camera.T_camera_lidar @ pose)
        moved = cloud @ back[:3, :3].T + back[:3, 3]
        sweeps.append(ldls.Sweep(moved, [ldls.View(masks, own)], pose, 0.1 * number))
    return sweeps


@pytest.mark.parametrize("base", [ldls.Params.paper(), ldls.Params()], ids=["paper", "best"])
@pytest.mark.parametrize("seed", range(20))
def test_labels_equal_those_of_plain_double_precision(seed, base):
    params = replace(base, **PLAIN)
    results = ldls.segment_sweeps(sweeps_of(seed), params=params)
    clouds, views = moments(seed)
    points = np.concatenate(clouds)
    ends = np.cumsum([0, *map(len, clouds)])
    in_view = np.concatenate([end + result.in_view for end, result in zip(ends, results, strict=False)])
    asked = {}
    if params.depth_gap:
        asked["heights"] = ldls.stages.ground(points[in_view], views[0][2])
        asked["centers"] = [np.linalg.inv(camera.T_camera_lidar)[:3, 3] for _, _, camera in views]
    plain = [(pixels, categories, camera.projection @ camera.T_camera_lidar) for pixels, categories, camera in views]
    rows = list(pairwise(ends.tolist()))
    labels, groups = oracle.segment_ring(
        points, plain, replace(params, neighbors=9), same_object=0.1, rows=rows, **asked
    )
    np.testing.assert_array_equal(np.concatenate([result.labels for result in results]), labels)
    for moment, result in enumerate(results):
        own = [tuple((0, mask) for view, mask in group if view == moment) for group in groups]
        assert list(result.sources) == own


@pytest.mark.parametrize("neighbors", [171, 255])
def test_no_more_neighbours_are_asked_for_than_the_core_takes(neighbors):
    most, more = (
        ldls.segment_sweeps(sweeps_of(3), params=replace(ldls.Params(**PLAIN), neighbors=each))
        for each in (170, neighbors)
    )
    for one, other in zip(most, more, strict=True):
        np.testing.assert_array_equal(one.labels, other.labels)
        assert other.params.neighbors == neighbors


def test_some_of_these_points_take_pixels_of_another_moment():
    # the oracle above would not see a rule that is never asked for
    lent = 0
    for seed in range(20):
        clouds, views = moments(seed)
        points, ends = np.concatenate(clouds), np.cumsum([0, *map(len, clouds)]).tolist()
        plain = [(pixels, kinds, camera.projection @ camera.T_camera_lidar) for pixels, kinds, camera in views]
        seen = [oracle.project(points, matrix, pixels.shape[1:], 0.1) for pixels, _, matrix in plain]
        rows = list(pairwise(ends))
        shown = oracle.points_shown(plain, seen)
        groups = oracle.same_objects(plain, seen, shown, 0.1, rows)
        taken = oracle.pixels_taken(plain, seen, shown, groups, rows)
        lent += sum(
            int(((own < start) | (own >= end)).sum()) for (own, _), (start, end) in zip(taken, rows, strict=True)
        )
    assert lent > 50


@turned
@pytest.mark.parametrize("seed", range(5))
def test_where_the_lidar_stood_does_not_matter(seed):
    still = ldls.segment_sweeps(sweeps_of(seed), params=ldls.Params.paper())
    moving = ldls.segment_sweeps(sweeps_of(seed, world_from_lidar=poses(seed)), params=ldls.Params.paper())
    for one, other in zip(still, moving, strict=True):
        np.testing.assert_array_equal(one.labels, other.labels)
        np.testing.assert_allclose(one.confidence, other.confidence, atol=1e-4)


def test_an_object_has_the_category_that_most_of_its_masks_have():
    first, second, third = (replace(sweep, pose=np.eye(4)) for sweep in sweeps_of(1))
    masks = first.views[0].masks
    named = {1: "car", 2: "truck"}
    kinds = ([1, 1, 1, 1], [2, 1, 1, 1], [1, 1, 2, 1])
    sweeps = [
        replace(sweep, views=[ldls.View(replace_categories(masks, kind, named), first.views[0].camera)])
        for sweep, kind in zip((first, second, third), kinds, strict=True)
    ]
    results = ldls.segment_sweeps(sweeps, params=replace(ldls.Params.paper(), **PLAIN))
    together = [instance for instance in results[0].instances if instance.sources]
    assert [instance.category for instance in together] == [1, 1, 1, 1]
    assert {instance.name for instance in together} == {"car"}
    for result in results:
        seen = [mask for instance in result.instances for _, mask in instance.sources]
        assert sorted(seen) == [0, 1, 2, 3]


def test_sweeps_whose_masks_are_numbered_each_in_its_own_way_are_as_by_one_numbering():
    sweeps = [replace(sweep, pose=np.eye(4)) for sweep in sweeps_of(1)]

    def named(tables):
        for sweep, table in zip(sweeps, tables, strict=True):
            (view,) = sweep.views
            ids = {name: category for category, name in table.items()}
            categories = [ids["car"], *[ids["cone"]] * (len(view.masks) - 1)]
            masks = replace_categories(view.masks, categories, table)
            yield replace(sweep, views=[ldls.View(masks, view.camera)])

    one, other = {100: "car", 101: "cone"}, {100: "cone", 101: "car"}
    params = replace(ldls.Params.paper(), **PLAIN)
    expected = ldls.segment_sweeps([*named([one, one, one])], params=params)
    results = ldls.segment_sweeps([*named([one, other, one])], params=params)
    for result, alike in zip(results, expected, strict=True):
        assert result.instances == alike.instances
        np.testing.assert_array_equal(result.labels, alike.labels)


def replace_categories(masks, categories, names):
    return ldls.InstanceMasks.from_array(masks.to_array(), categories=categories, names=names)


def test_one_sweep_gives_what_it_gives_alone():
    sweep = sweeps_of(1)[0]
    (together,) = ldls.segment_sweeps([sweep])
    alone = ldls.segment(sweep.points, sweep.views)
    for name in ("labels", "diffused_labels", "confidence", "in_view"):
        np.testing.assert_array_equal(getattr(together, name), getattr(alone, name))
    assert together.instances == alone.instances
    assert together.report == alone.report


@turned
def test_each_sweep_has_its_own_points_views_and_files(tmp_path):
    sweeps = sweeps_of(3, world_from_lidar=poses(3))
    results = ldls.segment_sweeps(sweeps)
    for sweep, result in zip(sweeps, results, strict=True):
        assert result.points is sweep.points
        assert result.views[0].view is sweep.views[0]
        own, pixels = ldls.stages.project(sweep.points, sweep.views[0].camera, image_size=(40, 60))
        np.testing.assert_array_equal(result.views[0].in_view, own)
        np.testing.assert_allclose(result.views[0].pixels, pixels, atol=1e-9)
        assert np.isin(own, result.in_view).all()
        assert np.array_equal(result.labels >= 0, np.isin(np.arange(len(sweep.points)), result.in_view))
        assert [i.label for i in result.instances] == [i.label for i in results[0].instances]
        for suffix in ("npz", "label", "ply", "csv"):
            ldls.save(result, tmp_path / f"sweep.{suffix}")
        again = ldls.read_result(tmp_path / "sweep.npz")
        assert again.instances == result.instances
        np.testing.assert_array_equal(again.views[0].labels, result.views[0].labels)
        assert again.to_table() == result.to_table()


def test_an_object_that_no_image_of_a_sweep_shows_has_no_mask_in_its_tables(tmp_path):
    with_mask, without = sweeps_of(2)[:2]
    without = replace(without, views=[replace(without.views[0], masks=without.views[0].masks.select([]))])
    _, result = ldls.segment_sweeps([with_mask, without], params=replace(ldls.Params.paper(), **PLAIN))
    rows = result.to_table()
    assert rows
    assert {(row["camera"], row["mask_width_px"]) for row in rows} == {("", None)}
    assert all(not instance.sources for instance in result.instances)
    ldls.save(result, tmp_path / "result.txt")
    assert [each.bbox for each in read_kitti_objects(tmp_path / "result.txt")] == [(-1, -1, -1, -1)] * len(rows)


def test_a_sweep_without_images_is_labelled_by_those_of_others():
    first, second, third = sweeps_of(4)
    results = ldls.segment_sweeps([first, replace(second, views=[]), third])
    assert (results[1].labels > 0).any()
    assert results[1].views == ()


@pytest.mark.parametrize(
    ("world", "doubtful"),
    [
        pytest.param(Rotation.identity(), False, id="z up"),
        pytest.param(Rotation.from_euler("zy", [170, 55], degrees=True), False, id="a steep ramp"),
        pytest.param(Rotation.from_euler("x", 180, degrees=True), True, id="north, east, down"),
        pytest.param(Rotation.from_matrix([[0, -1, 0], [0, 0, -1], [1, 0, 0]]), True, id="a camera's"),
    ],
)
def test_a_world_whose_z_is_not_up_is_warned_of_once(world, doubtful):
    stream = ldls.LabelDiffusion(before=0)
    pose = from_parts(world.as_matrix())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for stamp in range(3):
            ldls.Sweep(np.zeros((0, 3)), (), pose, float(stamp))
        assert [one.category for one in caught] == [UprightWarning] * doubtful
        stream.segment(np.ones((1, 3)), [], pose=pose, stamp=0.0)
        stream.segment(np.ones((1, 3)), [], pose=pose, stamp=0.1)
    assert len(caught) == 2 * doubtful
    assert all("z of the lidar does not point up along z of the world" in str(one.message) for one in caught)


def test_what_was_labelled_with_other_sweeps_is_not_explained_by_itself_alone(tmp_path):
    sweeps = sweeps_of(7)
    (alone,) = ldls.segment_sweeps(sweeps[:1])
    assert alone.report.n_sweeps == 1
    point = int(alone.in_view[0])
    assert ldls.explain(alone, point).label == alone.labels[point]
    result, _ = ldls.segment_sweeps(sweeps[:2])
    ldls.save(result, tmp_path / "result.npz")
    for each in (result, ldls.read_result(tmp_path / "result.npz")):
        assert each.report.n_sweeps == 2
        with pytest.raises(ldls.InputError, match="its graph has 2 sweeps, of which it holds one"):
            ldls.explain(each, int(each.in_view[0]))


@turned
def test_missing_returns_stay_missing():
    sweeps = sweeps_of(5, world_from_lidar=poses(5))
    points = sweeps[0].points.copy()
    points[::2] = 0
    points[1] = np.nan
    results = ldls.segment_sweeps([replace(sweeps[0], points=points), *sweeps[1:]])
    assert (results[0].labels[::2] == -1).all()
    assert results[0].labels[1] == -1
    with pytest.raises(ldls.NonFiniteError, match="row 1"):
        ldls.segment_sweeps([replace(sweeps[0], points=points)], nonfinite="raise")


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_do_not_change_a_bit(threads):
    one, other = (ldls.segment_sweeps(sweeps_of(6), params=ldls.Params(threads=n)) for n in (1, threads))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.labels, b.labels)
        np.testing.assert_array_equal(a.confidence, b.confidence)


def test_misuse_is_named():
    with pytest.raises(ldls.InputError, match="got none, expected one or more"):
        ldls.segment_sweeps([])
    with pytest.raises(ldls.InputError, match="list of View, got int"):
        ldls.Sweep(np.zeros((1, 3)), [3], np.eye(4), 0.0)
    with pytest.raises(ldls.ParameterError, match="stamp: got None, expected a finite number"):
        ldls.Sweep(np.zeros((1, 3)), [], np.eye(4), None)
    for stamp in (np.nan, np.inf, -np.inf):
        with pytest.raises(ldls.ParameterError, match=f"stamp: got {stamp}, expected seconds"):
            ldls.Sweep(np.zeros((1, 3)), [], np.eye(4), stamp)
    with pytest.raises(ldls.CalibrationError, match="pose: R"):
        ldls.Sweep(np.zeros((1, 3)), [], 2 * np.eye(4), 0.0)
    for row, column in ((0, 0), (0, 3)):
        pose = np.eye(4)
        pose[row, column] = np.nan
        with pytest.raises(ldls.CalibrationError, match="pose: has numbers that are not finite, expected a rotation"):
            ldls.Sweep(np.zeros((1, 3)), [], pose, 0.0)
    with pytest.raises(ldls.InputError, match=re.escape("points: row 1 has a coordinate of -1e+30 m, expected |x|")):
        ldls.Sweep([[np.inf, 0, 0], [0, -1e30, np.nan]], [], np.eye(4), 0.0)
    # columns of other things may have any value
    ldls.Sweep([[0, 0, 0, 1e9], [np.nan, 0, 0, 0], [np.inf, 0, 0, 0]], [], np.eye(4), 0.0)


def test_sweeps_in_another_order_than_their_stamps_are_refused():
    first, second, third = sweeps_of(1)
    with pytest.raises(ldls.InputError, match=r"sweeps: one of 0.1 s comes after one of 0.2 s; sort them"):
        ldls.segment_sweeps([first, third, second])
    with pytest.raises(ldls.InputError, match=r"sweeps: two have the stamp 0.0 s; leave one of them out"):
        ldls.segment_sweeps([first, replace(second, stamp=0.0)])


def test_sweeps_that_jump_are_refused():
    first, second, _ = sweeps_of(1)
    pose = second.pose.copy()
    pose[0, 3] += 5000
    with pytest.raises(ldls.PoseError, match=r"the lidar moves 50\d\d.* expected at most 100 m/s"):
        ldls.segment_sweeps([first, replace(second, pose=pose)])


@pytest.mark.parametrize(
    ("change", "category", "message"),
    [
        pytest.param(lambda points: points * 1e4, ScaleWarning, "points: extent is", id="tenths of a millimetre"),
        pytest.param(lambda points: points * np.nan, NoUsablePoints, "sweep 1: points: no row is finite", id="NaN"),
        pytest.param(lambda points: -points, NothingInView, "sweep 1: points: every point lies behind", id="behind"),
    ],
)
def test_what_is_odd_about_a_sweep_is_warned_of_as_of_a_single_cloud(change, category, message):
    camera = ldls.Camera(projection=[[50, 0, 40], [0, 50, 30], [0, 0, 1]])
    masks = ldls.InstanceMasks.from_array(np.ones((1, 60, 80), bool))
    points = np.random.default_rng(0).uniform([-1, -1, 8], [1, 1, 12], (100, 3))
    views = [ldls.View(masks, camera)]
    sweeps = [ldls.Sweep(points, views, np.eye(4), 0.0), ldls.Sweep(change(points), views, np.eye(4), 0.1)]
    with pytest.warns(category, match=f"^{message}") as caught:
        ldls.segment_sweeps(sweeps)
    assert caught[0].filename == __file__


def test_the_cause_of_several_sweeps_is_warned_of_once():
    camera = ldls.Camera(projection=[[50, 0, 40], [0, 50, 30], [0, 0, 1]])
    views = [ldls.View(ldls.InstanceMasks.from_array(np.ones((1, 60, 80), bool)), camera)]
    behind = np.random.default_rng(0).uniform([-1, -1, -12], [1, 1, -8], (100, 3))
    with pytest.warns(NothingInView, match="^sweep 0, sweep 1: points: every point lies behind") as caught:
        ldls.segment_sweeps([ldls.Sweep(behind, views, np.eye(4), 0.1 * at) for at in range(2)])
    assert len(caught) == 1
