"""`segment`: the input it accepts and refuses, its report and its result."""

import json
import multiprocessing
import sys
import threading
import types
import warnings
from dataclasses import replace

import numpy as np
import pytest

import ldls
from conftest import pinhole
from ldls.camera.rigid import from_parts
from ldls.errors import (
    DuplicateWarning,
    ImageSizeWarning,
    NoUsablePoints,
    PrecisionWarning,
    ScaleWarning,
    UprightWarning,
)
from ring_samples import as_views, random_ring


def test_shapes_and_types_of_the_result(small_scene):
    points, masks, camera = small_scene
    result = ldls.segment(points, masks, camera)
    n = len(points)
    assert (result.labels.dtype, result.labels.shape) == (np.int32, (n,))
    assert (result.diffused_labels.dtype, result.categories.dtype) == (np.int32, np.int32)
    assert (result.confidence.dtype, result.in_view.dtype) == (np.float32, np.int64)
    assert set(np.unique(result.labels)) == {0, 1, 2}
    assert set(np.unique(result.categories)) == {0, 1, 3}
    assert (result.categories[result.labels == 2] == 3).all()
    in_view = result.confidence[result.in_view]
    assert ((in_view > 0) & (in_view <= 1)).all()
    assert "2 of 2 objects found" in repr(result)
    assert set(result.timings) == {
        "project", "depth", "pixel_labels", "neighbors", "graph", "diffusion", "components",
    }  # fmt: skip


def test_values_of_labels_become_values_of_points(small_scene):
    points, masks, camera = small_scene
    result = ldls.segment(np.vstack([points, [[0, 0, -5]]]), masks, camera)
    labels = np.array([0, 1, 2], np.int64)
    np.testing.assert_array_equal(result.per_point(labels), np.maximum(result.labels, 0))
    np.testing.assert_array_equal(result.per_point(labels, out_of_view=-1), result.labels)
    colours = np.arange(9, dtype=np.uint8).reshape(3, 3)
    assert result.per_point(colours).shape == (len(result.labels), 3)
    assert result.per_point(colours, out_of_view=(7, 8, 9))[-1].tolist() == [7, 8, 9]
    assert {*result.per_point([None, "person", "car"])} == {None, "person", "car"}
    words = result.per_point(["bg", "person", "car"], out_of_view="none")
    assert words[-1] == "none"
    assert result.per_point([0.0, 0.1, 0.2], out_of_view=0.3)[-1] == 0.3


@pytest.mark.parametrize(
    ("values", "out_of_view"),
    [
        pytest.param(["bg", "car", "van"], "unknown", id="a longer word"),
        pytest.param([0, 1, 2], 0.5, id="half a number"),
        pytest.param(np.array([0, 1, 2], np.float32), 1e300, id="beyond single precision"),
        pytest.param(np.array([0, 1, 2], np.uint8), -1, id="below 0"),
    ],
)
def test_a_value_out_of_view_that_values_cannot_hold_is_refused(small_scene, values, out_of_view):
    with pytest.raises(ldls.DtypeError, match="out_of_view: expected"):
        ldls.segment(*small_scene).per_point(values, out_of_view=out_of_view)


def test_objects_describe_their_points(small_scene):
    points, masks, camera = small_scene
    result = ldls.segment(points, masks, camera)
    for label, found in enumerate(result.objects, start=1):
        members = points[result.labels == label]
        assert (found.label, found.n_points) == (label, len(members))
        np.testing.assert_allclose(found.centroid, members.mean(axis=0), rtol=1e-5)
        np.testing.assert_allclose(found.distance_m, np.linalg.norm(members.mean(axis=0, dtype=np.float64)))
        assert found.box.size[0] >= found.box.size[1]
    assert [found.name for found in result.objects] == ["person", "car"]


def test_objects_are_rows_of_plain_values(small_scene):
    points, masks, camera = small_scene
    empty = ldls.InstanceMasks.from_array(np.zeros((1, 60, 80), bool), categories=[7])
    result = ldls.segment(
        points,
        ldls.InstanceMasks.from_array(np.concatenate([empty.to_array(), masks.to_array()]), categories=[7, 1, 3]),
        camera,
    )
    person, car = result.to_table()
    assert list(person) == list(car) == [
        "label", "track", "category", "name", "score", "n_points", "distance_m",
        "centroid_x_m", "centroid_y_m", "centroid_z_m", "box_x_m", "box_y_m", "box_z_m", "length_m", "width_m",
        "height_m", "yaw_rad", "velocity_x_m_s", "velocity_y_m_s",
        "camera", "mask_left_px", "mask_top_px", "mask_width_px", "mask_height_px",
    ]  # fmt: skip
    found = result.objects[2]
    assert list(car.values()) == [
        3, 0, 3, "car", 1.0, found.n_points, found.distance_m, *found.centroid, *found.box.center, *found.box.size,
        found.box.yaw, 0.0, 0.0, "camera 0", 51, 23, 12, 15,
    ]  # fmt: skip
    assert {type(value) for value in car.values()} == {int, str, float}
    assert json.loads(json.dumps([person, car])) == [person, car]
    nothing = ldls.segment(points, empty, camera)
    assert nothing.to_table() == []


def test_rows_have_the_mask_of_the_first_camera_that_shows_the_object():
    points, views = random_ring(3)
    result = ldls.segment(points, as_views(views))
    rows = result.to_table()
    assert {row["camera"] for row in rows} == {"camera 0", "camera 1", "camera 2"}
    for row in rows:
        view, mask = min(result.instances[row["label"] - 1].sources)
        top, left, height, width = result.views[view].view.masks[mask].bounding_box
        box = [row[f"mask_{side}_px"] for side in ("left", "top", "width", "height")]
        assert (row["camera"], box) == (f"camera {view}", [left, top, width, height])


@pytest.mark.parametrize(
    "convert",
    [
        pytest.param(np.asfortranarray, id="Fortran order"),
        pytest.param(lambda p: np.repeat(p, 2, axis=0)[::2], id="every other row"),
        pytest.param(lambda p: np.ascontiguousarray(p.T).T, id="transposed"),
        pytest.param(lambda p: p[::-1].copy()[::-1], id="negative strides"),
        pytest.param(lambda p: p.astype(">f4"), id="big-endian"),
        pytest.param(lambda p: np.hstack([p, p]), id="more columns"),
        pytest.param(lambda p: np.hstack([p, p])[:, :3], id="some columns of more"),
        pytest.param(lambda p: p.tolist(), id="nested lists"),
        pytest.param(lambda p: misaligned(p), id="misaligned"),
        pytest.param(lambda p: read_only(p), id="read-only"),
    ],
)
def test_any_layout_gives_the_same_bits(small_scene, convert):
    points, masks, camera = small_scene
    expected = ldls.segment(points, masks, camera)
    result = ldls.segment(convert(points), masks, camera)
    assert result.labels.tobytes() == expected.labels.tobytes()
    assert result.confidence.tobytes() == expected.confidence.tobytes()


def misaligned(points):
    moved = np.frombuffer(b"\0" + points.tobytes(), np.uint8)[1:].view(np.float32).reshape(points.shape)
    assert not moved.flags.aligned
    return moved


def read_only(points):
    points = points.copy()
    points.flags.writeable = False
    return points


@pytest.mark.parametrize(
    ("points", "error", "message"),
    [
        pytest.param(np.zeros((3, 100)), ldls.ShapeError, r"got \(3, 100\); transpose", id="(3, N)"),
        pytest.param(np.zeros((100, 2)), ldls.ShapeError, r"points: .*\(100, 2\)", id="(N, 2)"),
        pytest.param(np.zeros(9), ldls.ShapeError, r"points: .*\(9,\)", id="(N,)"),
        pytest.param(np.zeros((2, 3, 4)), ldls.ShapeError, "points", id="3-D"),
        pytest.param(np.zeros((4, 3), int), ldls.DtypeError, "got int64; pass points.ast", id="int"),
        pytest.param(np.zeros((4, 3), "f2"), ldls.DtypeError, "got float16", id="float16"),
        pytest.param(np.zeros((4, 3), complex), ldls.DtypeError, "complex", id="complex"),
        pytest.param(np.zeros((4, 3), object), ldls.DtypeError, "object", id="object"),
        pytest.param(np.ma.zeros((4, 3)), ldls.DtypeError, "masked array", id="masked"),
        pytest.param(np.full((4, 3), 1e30), ldls.InputError, "row 0 has a coordinate of 1e30", id="far"),
    ],
)
def test_points_that_cannot_be_used_are_refused(small_scene, points, error, message):
    _, masks, camera = small_scene
    with pytest.raises(error, match=message) as caught:
        ldls.segment(points, masks, camera)
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, TypeError) == (error is ldls.DtypeError)


def test_a_module_that_another_thread_is_importing_is_no_hindrance(small_scene, monkeypatch):
    points, masks, camera = small_scene
    for name in ("numpy.ma", "numpy.typing"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    assert len(ldls.segment(points, masks, camera).labels) == len(points)


def test_other_arguments_are_refused_by_name(small_scene):
    points, masks, camera = small_scene
    with pytest.raises(ldls.InputError, match="^masks: expected InstanceMasks or a list of View, got ndarray"):
        ldls.segment(points, masks.to_array(), camera)
    with pytest.raises(ldls.InputError, match="^camera: expected Camera, got ndarray"):
        ldls.segment(points, masks, camera.projection)
    with pytest.raises(ldls.ParameterError, match="^nonfinite: got 'ignore'"):
        ldls.segment(points, masks, camera, nonfinite="ignore")
    sized = pinhole(image_size=(80, 60))
    with pytest.raises(ldls.MaskError, match=r"\(60, 80\), the camera's image is \(80, 60\); swapped"):
        ldls.segment(points, masks, sized)


@pytest.mark.parametrize(
    ("first", "second", "name"),
    [
        pytest.param("left", "left", "left", id="twice"),
        pytest.param("camera 1", "", "camera 1", id="the name of one without a name"),
    ],
)
def test_two_views_of_one_name_are_refused(small_scene, first, second, name):
    points, masks, camera = small_scene
    views = [ldls.View(masks, camera, first), ldls.View(masks, camera, second)]
    pose = {"pose": np.eye(4), "stamp": 0.0}
    for label in (
        lambda: ldls.segment(points, views),
        lambda: ldls.LabelDiffusion().segment(points, views),
        lambda: ldls.LabelDiffusion().segment(points, views, **pose),
        lambda: ldls.segment_sweeps([ldls.Sweep(points, views, **pose)]),
    ):
        with pytest.raises(ldls.InputError, match=f"^views: 2 have the name '{name}', expected one each"):
            label()
    assert len(ldls.segment(points, views[::-1] if first != second else views[:1]).labels) == len(points)


def test_points_without_coordinates_are_left_out_and_counted(small_scene):
    points, masks, camera = small_scene
    clean = ldls.segment(points, masks, camera)
    holes = np.insert(points, [0, 100, 500], [[np.nan, 0, 9], [0, np.inf, 9], [0, 0, 0]], axis=0)
    result = ldls.segment(holes, masks, camera)
    assert (result.report.n_nonfinite, result.report.n_origin) == (2, 1)
    assert result.labels[[0, 101, 502]].tolist() == [-1, -1, -1]
    kept = np.delete(result.labels, [0, 101, 502])
    np.testing.assert_array_equal(kept, clean.labels)
    with pytest.raises(ldls.NonFiniteError, match="501 of 503 rows are finite, row 0 is the first"):
        ldls.segment(holes, masks, camera, nonfinite="raise")


def test_the_origin_can_be_a_point(small_scene):
    _, masks, _ = small_scene
    camera = pinhole(T_camera_lidar=from_parts(np.eye(3), [0, 0, 5]))
    origin = np.zeros((1, 3))
    assert ldls.segment(origin, masks, camera).labels.tolist() == [-1]
    assert ldls.segment(origin, masks, camera, keep_origin=True).labels.tolist() == [0]


def test_every_point_is_accounted_for(small_scene):
    points, masks, camera = small_scene
    scattered = np.concatenate([points, -points, points * [5, 5, 1]]).astype(np.float32)
    report = ldls.segment(scattered, masks, camera).report
    assert report.n_points == 1500
    assert report.n_behind == 500  # the scene mirrored
    left_out = report.n_nonfinite + report.n_origin + report.n_behind + report.n_outside
    assert report.n_in_view + left_out == report.n_points


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        pytest.param(np.zeros((0, 3), np.float32), [], id="no points"),
        pytest.param([[0.0, 0, 10]], [0], id="one point"),
        pytest.param([[-1.5, 0, 10.0], [2.0, 0, 10], [0, 0, 10]], [1, 2, 0], id="fewer than K"),
        pytest.param([[0.0, 0, -10], [50, 0, 10]], [-1, -1], id="nothing in view"),
    ],
)
@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_clouds_with_next_to_nothing_are_fine(small_scene, points, expected):
    _, masks, camera = small_scene
    result = ldls.segment(points, masks, camera)
    assert result.labels.tolist() == expected
    assert result.report.k_effective == max(len(result.in_view) - 1, 0)
    assert len(result.objects) == 2


def test_no_masks_make_everything_background(small_scene):
    points, masks, camera = small_scene
    none = ldls.InstanceMasks.from_array([], image_size=masks.image_size)
    result = ldls.segment(points, none, camera)
    assert (result.labels[result.in_view] == 0).all()
    assert result.objects == ()


def test_empty_and_total_masks_are_reported_and_used(small_scene):
    points, masks, camera = small_scene
    pixels = np.stack([np.zeros(masks.image_size, bool), np.ones(masks.image_size, bool)])
    params = ldls.Params.paper()
    result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera, params=params)
    assert result.report.empty_masks == (1,)
    assert (result.diffused_labels[result.in_view] == 2).all()
    assert result.objects[0].box is None
    assert result.objects[0].distance_m is None


def test_more_instances_than_a_byte_counts(small_scene):
    points, masks_of_scene, camera = small_scene
    pixels = np.zeros((300, 60, 80), bool)
    pixels[298] = masks_of_scene.to_array()[0]
    result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera)
    assert set(np.unique(result.labels)) == {0, 299}


def test_copies_get_one_label_whatever_their_order(small_scene):
    points, masks, camera = small_scene
    doubled = np.repeat(points, 2, axis=0)
    result = ldls.segment(doubled, masks, camera)
    np.testing.assert_array_equal(result.labels[::2], result.labels[1::2])
    assert result.report.n_duplicates == len(result.in_view)
    shuffled = np.random.default_rng(0).permutation(len(doubled))
    again = ldls.segment(doubled[shuffled], masks, camera)
    np.testing.assert_array_equal(again.labels, result.labels[shuffled])


def test_a_cloud_of_copies_is_reported(small_scene):
    points, masks, camera = small_scene
    with pytest.warns(DuplicateWarning, match="more copies than neighbours"):
        result = ldls.segment(np.repeat(points, 12, axis=0), masks, camera)
    assert np.isfinite(result.confidence).all()


def test_map_coordinates_in_double_precision_keep_their_precision(small_scene):
    points, masks, camera = small_scene
    points = np.round(points.astype(np.float64) * 1024) / 1024
    offset = np.array([500_000.0, 5_000_000.0, 100.0])
    shifted = ldls.Camera(projection=camera.projection, T_camera_lidar=from_parts(np.eye(3), -offset))
    local = ldls.segment(points, masks, camera)
    far = ldls.segment(points + offset, masks, shifted)
    assert far.labels.tobytes() == local.labels.tobytes()
    assert far.confidence.tobytes() == local.confidence.tobytes()
    with pytest.warns(PrecisionWarning, match="float32 spacing at 5.0e\\+06 is 0.5 m"):
        ldls.segment((points + offset).astype(np.float32), masks, shifted)


@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_single_precision_is_warned_of_once_its_steps_pass_a_centimetre(small_scene):
    points, masks, camera = small_scene
    # from 2^17 m = 131,072 m on, float32 has steps of 1/64 m
    near, far = (points + np.float32([0, offset, 0]) for offset in (131_000, 131_100))
    ldls.segment(near, masks, camera)
    with pytest.warns(PrecisionWarning, match="float32 spacing at 1.3e\\+05 is 0.016 m"):
        ldls.segment(far, masks, camera)


def test_millimetres_for_metres_are_suspected(small_scene):
    points, masks, camera = small_scene
    with pytest.warns(ScaleWarning, match="are they in metres"):
        ldls.segment(points.astype(np.float64) * 1e4, masks, camera)


@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_a_translation_in_millimetres_is_suspected(small_scene):
    _, masks, camera = small_scene
    around = np.random.default_rng(3).uniform(-60, 60, (500, 3))
    far = replace(camera, T_camera_lidar=from_parts(np.eye(3), [-270, 60, -80]))
    with pytest.warns(ScaleWarning, match="camera 0: T_camera_lidar: the lidar is 288 m from the camera"):
        ldls.segment(around, masks, far)
    # a map whose origin is elsewhere, points of a part of it, and a camera amid them
    for points in (around + np.array([270, -60, 80]), around[around[:, 0] < -9], 5 * around):
        ldls.segment(points, masks, far)


def test_masks_of_rows_for_columns_are_doubted():
    masks = ldls.InstanceMasks.from_boxes([[3, 2, 5, 4]], (160, 60))
    camera = ldls.Camera(projection=[[100, 0, 80], [0, 100, 30], [0, 0, 1]])
    with pytest.warns(ImageSizeWarning, match="is the middle of about 60 x 160; are rows and columns of the masks"):
        ldls.segment(np.array([[-4.0, 0, 10]]), masks, camera)


@pytest.mark.parametrize(
    ("size", "doubtful"),
    [
        pytest.param((120, 160), False, id="as the camera's"),
        pytest.param((60, 80), True, id="half as large"),
        pytest.param((240, 320), True, id="twice as large"),
        pytest.param((60, 160), False, id="cut below"),
        pytest.param((90, 120), False, id="a little smaller"),
    ],
)
def test_masks_of_a_resized_image_are_doubted(size, doubtful):
    points, masks = np.array([[0.0, 0, 10]] * 9), ldls.InstanceMasks.from_boxes([[3, 2, 5, 4]], size)
    camera = ldls.Camera(projection=2 * np.array([[100, 0, 80], [0, 100, 60], [0, 0, 1]]))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ldls.segment(points, masks, camera)
        ldls.segment(points, masks, replace(camera, image_size=size))
    said = [str(one.message) for one in caught if one.category is ImageSizeWarning]
    assert len(said) == doubtful
    if doubtful:
        assert f"camera 0: masks: of an image of {size[0]} x {size[1]}" in said[0]
        assert "(80.0, 60.0) is the middle of about 120 x 160" in said[0]
        assert f"right, as of an image that was cropped, give the camera image_size={size}" in said[0]


def test_a_cloud_of_nans_is_warned_of(small_scene):
    _, masks, camera = small_scene
    with pytest.warns(NoUsablePoints, match="^points: no row is finite"):
        result = ldls.segment(np.full((9, 3), np.nan), masks, camera)
    assert (result.labels == -1).all()


def test_arguments_stay_as_they_are(small_scene):
    points, masks, camera = small_scene
    before = points.copy()
    ldls.segment(points, masks, camera)
    assert points.tobytes() == before.tobytes()


def test_mask_order_does_not_matter(small_scene):
    points, masks, camera = small_scene
    pixels = masks.to_array()
    pixels[1, 25:35, 20:60] = True  # overlaps the first
    forward = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera)
    backward = ldls.segment(points, ldls.InstanceMasks.from_array(pixels[::-1]), camera)
    swapped = np.array([0, 2, 1, -1])[backward.labels]
    np.testing.assert_array_equal(forward.labels, swapped)


def test_many_python_threads_may_call_at_once(small_scene):
    points, masks, camera = small_scene
    expected = ldls.segment(points, masks, camera).labels.tobytes()
    found = []

    def work():
        found.extend(ldls.segment(points, masks, camera).labels.tobytes() for _ in range(20))

    workers = [threading.Thread(target=work) for _ in range(8)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert found == [expected] * 160


def test_other_threads_run_meanwhile(small_scene):
    _, masks, camera = small_scene
    points = np.random.default_rng(0).uniform([-4, -3, 9], [4, 3, 11], (200_000, 3))
    running = threading.Event()
    done = threading.Event()
    count = 0

    def work():
        running.set()
        ldls.segment(points, masks, camera)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    running.wait()
    while not done.wait(timeout=0.001):
        count += 1
    thread.join()
    assert count > 10, "the GIL was held"


def segment_in_child(arguments, answers):
    answers.put(ldls.segment(*arguments).labels.tobytes())


@pytest.mark.skipif(sys.platform == "win32", reason="no fork on Windows")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_child_computes_the_same(small_scene):
    points, masks, camera = small_scene
    expected = ldls.segment(points, masks, camera).labels.tobytes()
    context = multiprocessing.get_context("fork")
    answers = context.SimpleQueue()
    child = context.Process(target=segment_in_child, args=((points, masks, camera), answers))
    child.start()
    child.join(timeout=300)
    assert child.exitcode == 0
    assert answers.get() == expected


def test_a_bug_in_a_worker_is_an_internal_error_and_the_next_call_works(small_scene, capfd):
    points, masks, camera = small_scene
    with pytest.raises(ldls.InternalError, match=r"panic asked for \(at .*call\.rs:.*please report"):
        ldls._ldls.panic_in_worker()
    assert capfd.readouterr().err == ""
    assert len(ldls.segment(points, masks, camera).labels) == len(points)


def test_direct_labels_are_those_of_the_nearest_pixels(small_scene):
    points, masks, camera = small_scene
    points = np.vstack([points, [[0, 0, -5]]]).astype(np.float32)
    result = ldls.segment(points, masks, camera)
    pixels = np.floor(result.pixels + 0.5).astype(int)
    expected = np.full(len(points), -1)
    covered = masks.to_array()[:, pixels[:, 1], pixels[:, 0]]
    expected[result.in_view] = np.where(covered.any(axis=0), covered.argmax(axis=0) + 1, 0)
    np.testing.assert_array_equal(result.direct_labels, expected)
    assert (result.direct_labels == -1).any() and (result.direct_labels != result.labels).any()


def test_direct_labels_of_a_ring_are_those_of_the_first_camera_that_sees_an_instance(small_scene):
    points, masks, camera = small_scene
    first, second = masks.select([0]), masks.select([1])
    ring = ldls.segment(points, [ldls.View(first, camera), ldls.View(second, camera)])
    alone = ldls.segment(points, masks, camera)
    np.testing.assert_array_equal(ring.direct_labels, alone.direct_labels)


def test_where_two_cameras_see_different_instances_the_first_gives_the_direct_label(small_scene):
    points, masks, camera = small_scene
    other = ldls.InstanceMasks.from_array(masks.to_array()[:1], categories=[2])
    ring = ldls.segment(points, [ldls.View(masks, camera), ldls.View(other, camera)])
    assert [instance.category for instance in ring.instances] == [1, 3, 2]
    np.testing.assert_array_equal(ring.direct_labels, ldls.segment(points, masks, camera).direct_labels)
    assert (ring.direct_labels == 1).sum() > 50


@pytest.mark.parametrize(
    ("turn", "doubtful"),
    [
        pytest.param([[0, -1, 0], [0, 0, -1], [1, 0, 0]], False, id="as it should be"),
        pytest.param([[0, 1, 0], [0, 0, 1], [1, 0, 0]], True, id="upside down"),
        pytest.param([[0, 0, 1], [0, -1, 0], [1, 0, 0]], True, id="on its side"),
        pytest.param(np.eye(3), False, id="a cloud in the camera's frame"),
        pytest.param([[0, -1, 0], [1, 0, 0], [0, 0, 1]], False, id="a camera that looks up"),
    ],
)
def test_a_lidar_that_does_not_stand_upright_in_the_image_is_doubted(turn, doubtful):
    transform = np.eye(4)
    transform[:3, :3] = turn
    camera = pinhole(T_camera_lidar=transform)
    masks = ldls.InstanceMasks.from_boxes([[30, 20, 50, 40]], (60, 80))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ldls.segment(np.linalg.inv(transform)[:3, :3] @ [0.0, 0, 10] + np.zeros((50, 3)), masks, camera)
    said = [str(one.message) for one in caught if one.category is UprightWarning]
    assert bool(said) == doubtful
    assert all("z of the lidar does not point up in the image" in text for text in said)


def street_below(height_m):
    """A street with a kerb, walls and boxes on it, seen by a lidar `height_m` above: (N, 3), z up."""
    generator = np.random.default_rng(4)
    road = generator.uniform([2, -12, 0], [40, 12, 0.02], (4000, 3))
    walls = generator.uniform([2, -12, 0], [40, 12, 5], (2000, 3))
    walls[:, 1] = np.sign(walls[:, 1]) * 12
    boxes = generator.uniform([-1, -1, 0], [1, 1, 1.6], (1500, 3)) + generator.choice(
        [[9, -5, 0], [14, 4, 0], [22, 0, 0]], 1500
    )
    return np.vstack([road, walls, boxes]) - [0, 0, height_m]


AHEAD = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
DOWN = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, -1]])


@pytest.mark.parametrize(
    ("other_axes", "camera_axes", "height_m", "doubtful"),
    [
        pytest.param(np.eye(3), AHEAD, 1.7, False, id="z up"),
        pytest.param(AHEAD, AHEAD, 1.7, False, id="the camera's"),
        pytest.param([[0, -1, 0], [0, 0, 1], [-1, 0, 0]], AHEAD, 1.7, True, id="OpenGL's: y up, z back"),
        pytest.param([[0, 1, 0], [0, 0, 1], [1, 0, 0]], AHEAD, 1.7, True, id="y up, z ahead"),
        pytest.param([[1, 0, 0], [0, 0, 1], [0, -1, 0]], AHEAD, 1.7, True, id="y up, x ahead"),
        pytest.param(np.eye(3), DOWN, 20, False, id="a drone that looks straight down"),
    ],
)
def test_axes_of_which_z_is_not_up_are_doubted(other_axes, camera_axes, height_m, doubtful):
    other_axes, transform = np.array(other_axes, float), np.eye(4)
    transform[:3, :3] = camera_axes @ other_axes.T
    camera = pinhole(60.0, (160.0, 120.0), T_camera_lidar=transform)
    masks = ldls.InstanceMasks.from_boxes([[1, 1, 319, 239]], (240, 320))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ldls.segment(street_below(height_m) @ other_axes.T, masks, camera)
    assert any(one.category is UprightWarning for one in caught) == doubtful


@pytest.mark.parametrize("name", ["OpenGL's", "the camera's", "the lidar's"])
def test_real_frames_in_other_axes_are_doubted_where_z_is_not_up(kitti_frame, name):
    turn = np.eye(4)
    turn[:3, :3] = {"OpenGL's": [[0, -1, 0], [0, 0, 1], [-1, 0, 0]], "the camera's": AHEAD, "the lidar's": np.eye(3)}[
        name
    ]
    camera = replace(kitti_frame.camera, T_camera_lidar=kitti_frame.camera.T_camera_lidar @ turn.T)
    points = kitti_frame.points[:, :3] @ turn[:3, :3].T.astype(np.float32)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ldls.segment(points, kitti_frame.masks, camera)
    assert any(one.category is UprightWarning for one in caught) == (name == "OpenGL's")
