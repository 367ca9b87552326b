"""Faults of clouds, arrays, cameras, masks, parameters and processes that stand in no other file: one test each."""

import inspect
import os
import threading
import warnings

import numpy as np
import pytest

import ldls
from command import python
from conftest import pinhole
from ldls import stages
from ldls.errors import LdlsWarning


def labels_of(scene, points, **options):
    _, masks, camera = scene
    return ldls.segment(points, masks, camera, **options)


def test_a_cloud_of_nans_is_refused_where_they_are_forbidden(small_scene):
    with pytest.raises(ldls.NonFiniteError, match="^points: 0 of 1000 rows are finite, row 0 is the first"):
        labels_of(small_scene, np.full((1000, 3), np.nan), nonfinite="raise")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rows_that_are_not_finite_in_one_axis_are_left_out_and_counted(small_scene, axis, value):
    points = small_scene[0].copy()
    points[5::7, axis] = value
    result, clean = labels_of(small_scene, points), labels_of(small_scene, np.delete(points, np.s_[5::7], axis=0))
    assert result.report.n_nonfinite == len(points[5::7])
    assert (result.labels[5::7] == -1).all()
    assert np.delete(result.labels, np.s_[5::7]).tobytes() == clean.labels.tobytes()


def test_a_third_of_missing_returns_changes_nothing_for_the_others(small_scene):
    points = small_scene[0]
    holes = np.insert(points, np.arange(0, len(points), 2), 0, axis=0)
    result, clean = labels_of(small_scene, holes), labels_of(small_scene, points)
    missing = ~holes.any(axis=1)
    assert result.report.n_origin == missing.sum() == len(points) // 2
    assert (result.labels[missing] == -1).all()
    assert result.labels[~missing].tobytes() == clean.labels.tobytes()


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(
            np.insert(np.mgrid[-2:2:40j, -2:2:40j].reshape(2, -1).T, 2, 10, axis=1), id="a plane before the camera"
        ),
        pytest.param(np.insert(np.mgrid[-2:2:40j, 9:11:40j].reshape(2, -1).T, 1, 0, axis=1), id="a plane through it"),
        pytest.param(
            np.stack([np.full(500, 0.5), np.linspace(-3, 3, 500), np.full(500, 10)], axis=1), id="a vertical line"
        ),
        pytest.param(np.mgrid[-5:5:20j, -4:4:20j, 9:12:20j].reshape(3, -1).T, id="a lattice"),
        pytest.param(np.full((3000, 3), [0.1, 0.2, 10.0]), id="all in one place"),
    ],
)
def test_clouds_without_volume_have_the_neighbours_of_brute_force_and_finite_labels(small_scene, points):
    found, squared = stages.neighbors(points[:1200], 10)
    distances = ((points[:1200, None] - points[None, :1200]) ** 2).sum(axis=2)
    np.fill_diagonal(distances, np.inf)
    expected = np.argsort(distances, axis=1, kind="stable")[:, :10]
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(squared, np.take_along_axis(distances, expected, axis=1))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LdlsWarning)
        result = labels_of(small_scene, points)
    assert np.isfinite(result.confidence).all() and (result.labels >= -1).all()


def test_denormals_and_minus_zero_are_zero(small_scene):
    points = small_scene[0].astype(np.float64)
    points[::3, 0] = 0.0
    expected = labels_of(small_scene, points)
    for tiny in (-0.0, 5e-324, -1e-310):
        points[::3, 0] = tiny
        found = labels_of(small_scene, points)
        assert found.labels.tobytes() == expected.labels.tobytes()
        assert found.confidence.tobytes() == expected.confidence.tobytes()


def test_a_memory_map_is_an_array(small_scene, tmp_path):
    points = small_scene[0]
    np.save(tmp_path / "points.npy", points)
    mapped = np.load(tmp_path / "points.npy", mmap_mode="r")
    assert labels_of(small_scene, mapped).labels.tobytes() == labels_of(small_scene, points).labels.tobytes()


def test_an_object_that_fails_to_become_an_array_is_refused_by_name(small_scene):
    class OnAnotherDevice:
        def __array__(self, dtype=None, copy=None):
            raise TypeError("can't convert device type tensor to numpy. Use Tensor.cpu() first")

    with pytest.raises(ldls.DtypeError, match=r"^points: expected an array .*Use Tensor.cpu\(\) first"):
        labels_of(small_scene, OnAnotherDevice())


def test_no_function_writes_to_an_array_of_the_caller(small_scene):
    public = [*(getattr(ldls, name) for name in ldls.__all__), *vars(stages).values()]
    methods = [method for each in public if inspect.isclass(each) for method in vars(each).values()]
    functions = [inspect.unwrap(each) for each in [*public, *methods] if inspect.isfunction(each)]
    assert [each for each in functions if "out" in inspect.signature(each).parameters] == []
    with pytest.raises(TypeError, match=r"^segment\(\) got an unexpected keyword argument 'out'"):
        ldls.segment(*small_scene, out=small_scene[0])


def test_an_array_that_another_thread_writes_to_crashes_nothing(small_scene):
    points, masks, camera = small_scene
    shared, stop = np.array(points), threading.Event()

    def write():
        generator = np.random.default_rng(0)
        while not stop.is_set():
            shared[generator.integers(len(shared))] = generator.choice([0, np.nan, np.inf, 1e30, -5, 9], 3)
            shared[:] = points

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for _ in range(50):
            try:
                assert len(ldls.segment(shared, masks, camera).labels) == len(points)
            except ldls.LdlsError as error:
                assert not isinstance(error, ldls.InternalError)
    finally:
        stop.set()
        writer.join()
    assert len(ldls.segment(points, masks, camera).labels) == len(points)


def test_a_mirrored_point_gets_no_label(small_scene):
    points = small_scene[0]
    result = labels_of(small_scene, np.vstack([points, -points]))
    assert (result.labels[len(points) :] == -1).all() and result.report.n_behind == len(points)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param({"projection": np.zeros((3, 3))}, "rank below 3", id="K not yet sent"),
        pytest.param({"projection": np.diag([0.0, 100, 1])}, r"rank below 3 \(diagonal 0, 100, 1\)", id="fx is 0"),
        pytest.param({"T_camera_lidar": np.diag([1.1, 1, 1, 1])}, "deviates from orthonormal by 2.1", id="stretched"),
        pytest.param({"T_camera_lidar": np.diag([-1.0, 1, 1, 1])}, "determinant -1", id="mirrored"),
        pytest.param(
            {"T_camera_lidar": np.eye(4) + np.eye(4, k=-3)}, "is the matrix transposed", id="column by column"
        ),
        pytest.param({"T_camera_lidar": np.full((4, 4), np.nan)}, "is NaN", id="NaN"),
    ],
)
def test_a_camera_that_is_none_is_refused_with_what_was_found(arguments, message):
    matrices = {"projection": np.diag([100.0, 100, 1]), **arguments}
    with pytest.raises(ldls.CalibrationError, match=message):
        ldls.Camera(**matrices)


@pytest.mark.parametrize("model", ["fov", "omni", "thin_prism", ""])
def test_an_unknown_distortion_model_is_refused(model):
    coefficients = [0.1, 0.2, 0.3, 0.4]
    if model:
        with pytest.raises(ldls.CalibrationError, match=f"model '{model}' is unknown, expected one of none, plumb_bob"):
            ldls.Distortion(model, coefficients)
    else:
        message = {"K": np.eye(3).ravel(), "D": coefficients, "distortion_model": model}
        with pytest.raises(ldls.CalibrationError, match="distortion_model is missing beside D"):
            ldls.Camera.from_camera_info(message, np.eye(4))


def test_a_pixel_under_two_masks_counts_for_both():
    pixels = np.ones((2, 5, 5), bool)
    labels = stages.pixel_labels([[2, 2]], ldls.InstanceMasks.from_array(pixels), window=3, pixel_weight=1.0)
    assert labels.weights.toarray().tolist() == [[0, 9, 9]] and labels.mass.tolist() == [9]


def test_more_masks_than_sixteen_bits_count_are_over_the_limit():
    assert len(ldls.InstanceMasks.from_array(np.zeros((65_535, 1, 1), bool))) == 65_535
    with pytest.raises(ldls.LimitError, match="65536 instances exceed the limit of 65535"):
        ldls.InstanceMasks.from_array(np.zeros((65_536, 1, 1), bool))
    rle = ldls._ldls.Rle.from_pixels(np.zeros((1, 1), bool))
    with pytest.raises(ldls.LimitError):
        ldls.InstanceMasks([rle] * 65_536, (1, 1))


def test_a_mask_of_one_pixel_is_a_mask(small_scene):
    points, masks, camera = small_scene
    pixels = np.zeros((1, *masks.image_size), bool)
    u, v = np.floor(labels_of(small_scene, points).pixels[0] + 0.5).astype(int)
    pixels[0, v, u] = True
    result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera)
    assert result.report.empty_masks == ()
    assert result.direct_labels[result.in_view[0]] == 1


@pytest.mark.parametrize("size", [[2**31, 2**31], [2**63, 1], [-4, 4], [4.0, 4.0], [0, 4], "44", None, [4], [4, True]])
def test_run_lengths_of_an_impossible_size_are_refused_before_any_memory_is_taken(size):
    for counts in ("04", [16], b"04"):
        annotation = {"id": 17, "category_id": 1, "segmentation": {"size": size, "counts": counts}}
        with pytest.raises((ldls.MaskError, ldls.LimitError)):
            ldls.InstanceMasks.from_coco([annotation])


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        pytest.param([8], r"sum to 8, .*10 x 10.* 100", id="too few"),
        pytest.param([101], "sum to 101", id="too many"),
        pytest.param("", "sum to 0", id="nothing"),
        pytest.param(b"", "sum to 0", id="no bytes"),
        pytest.param("!", "outside 48 to 111", id="a byte below"),
        pytest.param("\x7f", "outside 48 to 111", id="a byte above"),
        pytest.param("\u00e9", "outside 48 to 111", id="no ASCII"),
        pytest.param("ooooooooo0", "more than 7 digits", id="over 32 bits"),
        pytest.param("oo", "ends within a number", id="cut"),
        pytest.param("O", "negative", id="negative"),
        pytest.param([-1, 101], "run 0 is -1", id="a negative run"),
        pytest.param([2**32 + 100], "run 0 is 4294967396", id="a run of 33 bits"),
        pytest.param([1.0, 99.0], "whole numbers", id="floats"),
        pytest.param(None, "whole numbers", id="none"),
    ],
)
def test_malformed_run_lengths_are_refused_with_the_annotation(counts, message):
    annotation = {"id": 17, "category_id": 1, "segmentation": {"size": [10, 10], "counts": counts}}
    with pytest.raises(ldls.MaskError, match=f"annotation 17: .*{message}"):
        ldls.InstanceMasks.from_coco([annotation])


def test_a_diffusion_that_does_not_converge_says_so_and_is_finite(small_scene):
    result = labels_of(small_scene, small_scene[0], params=ldls.Params(iterations=1))
    assert not result.report.converged and result.report.residual is None
    assert np.isfinite(result.confidence).all()


def test_points_without_edges_are_background_and_finite():
    from scipy.sparse import csr_array

    graph = csr_array(np.zeros((3, 3), np.float32))
    weights = csr_array(np.array([[0, 1], [0, 0], [0, 0]], np.float32))
    A, b = stages.normalize_rows(graph, stages.PixelLabels(weights, np.array([1, 0, 0], np.float32)))
    for iterations in (1, 50, None):
        assert stages.diffuse(A, b, iterations=iterations).tolist() == [[0, 1], [0, 0], [0, 0]]


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity")
def test_one_pool_has_as_many_threads_as_the_process_may_use(monkeypatch):
    code = """
import os, threading
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import numpy as np
import ldls
assert ldls._ldls.default_threads() == 1
os.environ["LDLS_NUM_THREADS"] = "3"
def label():
    points = np.random.default_rng(0).uniform([-4, -3, 9], [4, 3, 11], (20_000, 3))
    ldls.segment(points, ldls.InstanceMasks.from_boxes([[20, 20, 40, 40]], (60, 80)),
        ldls.Camera(projection=[[100, 0, 40], [0, 100, 30], [0, 0, 1]]))
workers = [threading.Thread(target=label) for _ in range(8)]
[worker.start() for worker in workers]
[worker.join() for worker in workers]
names = [open(f"/proc/self/task/{task}/comm").read() for task in os.listdir("/proc/self/task")]
print(sorted(name.strip() for name in names if name.startswith("ldls")))
"""
    monkeypatch.delenv("LDLS_NUM_THREADS", raising=False)
    ended = python("-c", code)
    assert ended.stdout == "['ldls-0', 'ldls-1', 'ldls-2']\n", ended.stderr


def test_nothing_in_view_is_no_error():
    away = pinhole(T_camera_lidar=np.diag([-1.0, 1, -1, 1]))
    masks = ldls.InstanceMasks.from_boxes([[1, 1, 9, 9]], (60, 80))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LdlsWarning)
        result = ldls.segment(np.full((5, 3), [0.0, 0, 9]), masks, away)
    assert result.labels.tolist() == [-1] * 5 and result.report.n_behind == 5
