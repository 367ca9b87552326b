"""Segmentations come back from their files as they were, and files that are not whole are refused."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import ldls
from ldls.io.arrays import write_npz

PLAIN = ("labels", "diffused_labels", "confidence", "in_view", "points", "categories")


def same(one: ldls.Segmentation, other: ldls.Segmentation) -> None:
    assert one == other
    assert dict(one.timings) == dict(other.timings)
    assert [getattr(one, name).dtype for name in PLAIN] == [getattr(other, name).dtype for name in PLAIN]


def through_file(result: ldls.Segmentation, path) -> ldls.Segmentation:
    ldls.save(result, path)
    return ldls.read_result(path)


@pytest.fixture
def scene(small_scene):
    points, masks, camera = small_scene
    return np.vstack([points, [[0, 0, -5], [np.nan, 0, 1]]]).astype(np.float32), masks, camera


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_one_camera(scene, tmp_path, dtype):
    points, masks, camera = scene
    result = ldls.segment(points.astype(dtype), masks, camera, params=ldls.Params(iterations=None, threads=1))
    same(through_file(result, tmp_path / "a.npz"), result)


@pytest.mark.parametrize(
    ("of_params", "of_camera"),
    [
        pytest.param({"neighbors": np.int64(10), "iterations": np.int16(4), "window": np.uint8(5)}, {}, id="whole"),
        pytest.param(
            {"sigma": np.float32(0.1), "abstain": np.longdouble(0.25), "depth_gap": Fraction(1, 2)}, {}, id="real"
        ),
        pytest.param({"calibrated": np.bool_(True), "threads": np.int32(1)}, {}, id="flag and threads"),
        pytest.param({}, {"min_depth_m": np.float32(0.1), "image_size": (np.int64(60), np.int64(80))}, id="camera"),
    ],
)
def test_numbers_of_numpy_become_pythons_own(scene, tmp_path, of_params, of_camera):
    points, masks, camera = scene
    params, camera = replace(ldls.Params(threads=1), **of_params), replace(camera, **of_camera)
    for made, given in ((params, of_params), (camera, of_camera)):
        assert {type(getattr(made, name)) for name in given} <= {int, float, bool, tuple}
        assert all(getattr(made, name) == value for name, value in given.items())
    result = ldls.segment(points, masks, camera, params=params)
    same(through_file(result, tmp_path / "a.npz"), result)


def test_a_distorted_camera_of_known_size_with_a_name(scene, tmp_path):
    points, masks, _ = scene
    camera = ldls.Camera(
        projection=[[100, 0, 40], [0, 100, 30], [0, 0, 1]],
        distortion=ldls.Distortion("plumb_bob", (0.1, -0.02, 0.001, 0.002, 0.0)),
        image_size=(60, 80),
        min_depth_m=0.5,
    )
    result = ldls.segment(points, [ldls.View(masks, camera, "前")])
    same(through_file(result, tmp_path / "a.npz"), result)


def test_a_ring_whose_instances_merge(scene, tmp_path):
    points, masks, camera = scene
    second = ldls.InstanceMasks.from_array(masks.to_array()[::-1], categories=[3, 1], scores=[0.3, 0.95])
    result = ldls.segment(points, [ldls.View(masks, camera, "left"), ldls.View(second, camera, "right")])
    assert len(result.instances) == 2
    same(through_file(result, tmp_path / "a.npz"), result)


def test_tracks_and_velocities(scene, tmp_path):
    result = ldls.segment(*scene)
    instances = tuple(replace(i, track=70000 - i.label, velocity=(0.1 * i.label, -3.0)) for i in result.instances)
    found = through_file(replace(result, instances=instances), tmp_path / "a.npz")
    same(found, replace(result, instances=instances))
    assert [(each.track, each.velocity) for each in found.objects] == [(69999, (0.1, -3.0)), (69998, (0.2, -3.0))]
    assert found.instance_ids.tolist() == [0, 69999, 69998]


def test_no_points_and_no_masks(scene, tmp_path):
    _, masks, camera = scene
    nothing = masks.filter(min_score=1.0)
    result = ldls.segment(np.zeros((0, 3), np.float32), nothing, camera)
    same(through_file(result, tmp_path / "a.npz"), result)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        pytest.param({"labels": np.zeros(3, np.int32)}, r"labels: expected \(502,\) int32, got \(3,\)", id="too few"),
        pytest.param({"labels": np.full(502, 3, np.int32)}, "labels: expected -1 to 2, got 3", id="unknown instance"),
        pytest.param({"confidence": np.full(502, np.nan, np.float32)}, "confidence: expected 0 to 1", id="NaN"),
        pytest.param({"in_view": np.array([502])}, "in_view: expected 0 to 501", id="row beyond the end"),
        pytest.param({"points": np.zeros((502, 2))}, "points: expected shape", id="points without z"),
        pytest.param({"params": np.array("{}x")}, "Extra data", id="not JSON"),
        pytest.param({"params": np.array('{"neighbors": 0}')}, "neighbors", id="parameters out of range"),
        pytest.param({"report": np.array("{}")}, "empty_masks", id="report without fields"),
        pytest.param({"camera": np.array('{"projection": 1}')}, "image_size", id="camera without fields"),
        pytest.param({"masks_runs": np.zeros(1, np.uint32)}, "run_counts sum to", id="masks cut off"),
        pytest.param(
            {"object_name": np.array(["person"])}, r"object_category: expected \(1,\)", id="a name is missing"
        ),
        pytest.param(
            {"object_name": np.zeros(2)}, r"object_name: expected \(M,\) text, got \(2,\) float", id="no names"
        ),
        pytest.param(
            {"object_name": np.array([["a"], ["b"]])}, r"object_name: .* got \(2, 1\)", id="names of two axes"
        ),
        pytest.param({"object_score": np.ones((1, 2), np.float32)}, "object_score: expected", id="scores of two axes"),
        pytest.param({"object_score": np.full(2, np.nan, np.float32)}, "object_score: expected 0 to 1", id="score NaN"),
        pytest.param({"object_category": np.ones((1, 2), np.int32)}, "object_category: expected", id="categories"),
        pytest.param({"object_category": np.array(["1", "2"])}, "object_category: expected", id="categories in text"),
        pytest.param({"object_track": np.array([1.5, 2])}, "object_track: expected", id="broken tracks"),
        pytest.param(
            {"object_track": np.arange(2), "object_velocity": np.full((2, 2), np.nan)},
            "object_velocity: expected",
            id="velocity NaN",
        ),
    ],
)
def test_arrays_that_do_not_fit_are_refused(scene, tmp_path, spoil, message):
    path = tmp_path / "a.npz"
    ldls.save(ldls.segment(*scene), path)
    write_npz(path, dict(np.load(path)) | spoil)
    with pytest.raises(ldls.LdlsError, match=message) as error:
        ldls.read_result(path)
    assert str(error.value).startswith(str(path))


@pytest.mark.parametrize(
    ("row", "message"),
    [
        pytest.param([-0.6, 5], "u of pixels: expected -0.5 to 79.5, got -0.6", id="left"),
        pytest.param([1e6, 5], "u of pixels: expected -0.5 to 79.5", id="right"),
        pytest.param([5, -0.6], "v of pixels: expected -0.5 to 59.5, got -0.6", id="above"),
        pytest.param([5, 60], "v of pixels: expected -0.5 to 59.5, .* 60.0", id="below"),
        pytest.param([np.nan, 5], "pixels: expected", id="nan"),
    ],
)
def test_pixels_outside_of_the_image_are_refused(scene, tmp_path, row, message):
    path = tmp_path / "a.npz"
    ldls.save(ldls.segment(*scene), path)
    arrays = dict(np.load(path))
    arrays["pixels"][3] = row
    write_npz(path, arrays)
    with pytest.raises(ldls.CorruptFileError, match=message):
        ldls.read_result(path)


def test_a_missing_array_is_named(scene, tmp_path):
    path = tmp_path / "a.npz"
    ldls.save(ldls.segment(*scene), path)
    write_npz(path, {name: array for name, array in dict(np.load(path)).items() if name != "view_names"})
    with pytest.raises(ldls.CorruptFileError, match="view_names"):
        ldls.read_result(path)


def test_other_files_are_refused_by_what_they_are(scene, tmp_path):
    ldls.save(scene[1], tmp_path / "masks.npz")
    with pytest.raises(ldls.UnsupportedFormatError, match=r"expected those of ldls.save"):
        ldls.read_result(tmp_path / "masks.npz")
    ldls.save(ldls.segment(*scene), tmp_path / "old.npz")
    arrays = dict(np.load(tmp_path / "old.npz"))
    del arrays["points"]
    write_npz(tmp_path / "old.npz", arrays)
    with pytest.raises(ldls.UnsupportedFormatError, match="segment the frame again"):
        ldls.read_result(tmp_path / "old.npz")
    with pytest.raises(FileNotFoundError):
        ldls.read_result(tmp_path / "none.npz")
