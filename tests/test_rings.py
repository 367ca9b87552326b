from dataclasses import replace

import numpy as np
import pytest

import ldls
import oracle
from ring_samples import as_views, random_ring

WALL = np.stack(np.meshgrid(np.linspace(-3, 3, 90), np.linspace(-0.6, 0.6, 25), [1.0]), axis=-1).reshape(-1, 3)

# the wall is flat, so only a short reach keeps its rectangles apart
PARAMS = replace(ldls.Params.paper(), sigma=0.002, pixel_weight=0.1)


def segment(views, **options):
    return ldls.segment(WALL, views, params=PARAMS, **options)


def camera(left):
    return ldls.Camera(projection=[[20, 0, left], [0, 20, 15], [0, 0, 1]], image_size=(30, 40))


def masks(*rectangles, category=3, scores=None, names=None):
    pixels = np.zeros((len(rectangles), 30, 40), bool)
    for mask, (top, left, height, width) in zip(pixels, rectangles, strict=True):
        mask[top : top + height, left : left + width] = True
    return ldls.InstanceMasks.from_array(pixels, categories=[category] * len(rectangles), scores=scores, names=names)


def two_views():
    first = masks((5, 24, 12, 10), (5, 2, 8, 8), scores=[0.5, 0.9])
    second = masks((5, 4, 12, 10), (5, 30, 8, 8), scores=[0.8, 0.7])
    return [ldls.View(first, camera(40), "left"), ldls.View(second, camera(20))]


def test_one_view_gives_what_its_camera_gives():
    view = two_views()[0]
    ring, single = ldls.segment(WALL, [view]), ldls.segment(WALL, view.masks, view.camera)
    np.testing.assert_array_equal(ring.labels, single.labels)
    assert ring.sources == (((0, 0),), ((0, 1),))


def test_an_object_in_two_images_has_one_label():
    result = segment(two_views())
    assert result.sources == (((0, 0), (1, 0)), ((0, 1),), ((1, 1),))
    assert [instance.score for instance in result.instances] == pytest.approx([0.8, 0.9, 0.7])
    assert [seen.labels.tolist() for seen in result.views] == [[1, 2], [1, 3]]
    # whoever sees a point, it has one answer
    object_points = np.flatnonzero(result.labels == 1)
    for seen in result.views:
        assert np.isin(object_points, seen.in_view).all()
    assert result.report.n_in_view == len(np.union1d(*(seen.in_view for seen in result.views)))
    assert [found.n_points > 0 for found in result.objects] == [True] * 3


def test_categories_and_a_strict_bound_keep_instances_apart():
    left, right = two_views()
    other = ldls.View(masks((5, 4, 12, 10), (5, 30, 8, 8), category=1), camera(20))
    assert len(ldls.segment(WALL, [left, other]).instances) == 4
    shifted = ldls.View(masks((5, 9, 12, 10)), camera(20))
    assert len(ldls.segment(WALL, [left, shifted], same_object=0.9).instances) == 3
    assert len(ldls.segment(WALL, [left, shifted], same_object=0.2).instances) == 2
    assert right.name == ""


@pytest.mark.parametrize(
    ("left", "right", "found"),
    [
        pytest.param({100: "forklift"}, {100: "pallet"}, [(100, "forklift"), (101, "pallet")], id="two names, one id"),
        pytest.param({1: "car"}, {2: "Car"}, [(1, "car")], id="one name, two ids"),
        pytest.param({100: "forklift"}, {100: "forklift", 3: "car"}, [(100, "forklift")], id="one name, one id"),
    ],
)
def test_instances_of_views_that_number_in_their_own_way_are_joined_by_name(left, right, found):
    views = [
        ldls.View(masks((5, 24, 12, 10), category=next(iter(left)), names=left), camera(40)),
        ldls.View(masks((5, 4, 12, 10), category=next(iter(right)), names=right), camera(20)),
    ]
    result = segment(views)
    assert [(instance.category, instance.name) for instance in result.instances] == found
    assert [seen.view.masks for seen in result.views] == [view.masks for view in views]
    backward = segment(views[::-1])
    assert [instance.name.lower() for instance in backward.instances] == [name for _, name in found[::-1]]


def test_the_order_of_cameras_does_not_matter_but_for_names_of_labels():
    forward, backward = segment(two_views()), segment(two_views()[::-1])
    renamed = {0: 0, -1: -1, 1: 1, 2: 3, 3: 2}
    assert [renamed[label] for label in forward.labels.tolist()] == backward.labels.tolist()


def test_streams_and_files_take_rings(tmp_path):
    views = two_views()
    stream = ldls.LabelDiffusion([view.camera for view in views], PARAMS)
    expected = segment(views)
    for _ in range(2):
        found = stream.segment(WALL, [view.masks for view in views])
        np.testing.assert_array_equal(found.labels, expected.labels)
    for suffix in ("npz", "label", "ply"):
        ldls.save(expected, tmp_path / f"ring.{suffix}")
    labels = np.fromfile(tmp_path / "ring.label", "<u4")
    np.testing.assert_array_equal(labels >> 16, np.maximum(expected.labels, 0))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        pytest.param(lambda v: ldls.segment(WALL, v, camera(20)), ldls.InputError, "None beside views", id="camera"),
        pytest.param(lambda v: ldls.segment(WALL, [*v, 3]), ldls.InputError, "got int in a list", id="no view"),
        pytest.param(lambda v: ldls.segment(WALL, v, same_object=0), ldls.ParameterError, "same_object", id="bound"),
        pytest.param(
            lambda v: ldls.LabelDiffusion([camera(20)]).segment(WALL, [x.masks for x in v]),
            ldls.InputError,
            "2 images, expected 1",
            id="masks of too many images",
        ),
        pytest.param(lambda v: ldls.segment(WALL, v).masks, ldls.InputError, "2 cameras; take", id="masks of which"),
        pytest.param(lambda v: ldls.View(v[0].camera, v[0].masks), ldls.InputError, "expected Inst", id="exchanged"),
        pytest.param(
            lambda v: ldls.View(ldls.InstanceMasks.from_array(np.zeros((1, 40, 30), bool)), camera(20)),
            ldls.MaskError,
            "swapped",
            id="size",
        ),
    ],
)
def test_misuse_is_named(call, error, message):
    with pytest.raises(error, match=message):
        call(two_views())


def test_no_views_see_nothing():
    result = ldls.segment(WALL, [])
    assert (result.labels == -1).all()
    assert result.instances == ()


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_do_not_change_a_bit(threads):
    one, other = (ldls.segment(WALL, two_views(), params=ldls.Params(threads=n)) for n in (1, threads))
    np.testing.assert_array_equal(one.labels, other.labels)
    np.testing.assert_array_equal(one.confidence, other.confidence)


@pytest.mark.parametrize("base", [ldls.Params.paper(), ldls.Params()], ids=["paper", "best"])
@pytest.mark.parametrize("seed", range(40))
def test_labels_equal_those_of_plain_double_precision(seed, base):
    points, views = random_ring(seed)
    params = replace(base, neighbors=6, sigma=0.3, pixel_weight=0.01, iterations=40)
    plain = [(pixels, categories, one.projection @ one.T_camera_lidar) for pixels, categories, one in views]
    result = ldls.segment(points, as_views(views), params=params)
    asked = {}
    if params.depth_gap:
        asked["heights"] = ldls.stages.ground(points[result.in_view], views[0][2])
        asked["centers"] = [np.linalg.inv(one.T_camera_lidar)[:3, 3] for _, _, one in views]
    labels, groups = oracle.segment_ring(points, plain, params, **asked)
    assert [list(sources) for sources in result.sources] == groups
    np.testing.assert_array_equal(result.labels, labels)
