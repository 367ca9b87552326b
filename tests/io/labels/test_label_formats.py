from dataclasses import replace

import numpy as np
import pytest

import ldls
from evaluation.samples import labeling
from ldls.errors import (
    CorruptFileError,
    InputError,
    LimitError,
    ParameterError,
    TruncatedFileError,
    UnsafeFileError,
    UnsupportedFormatError,
)
from ldls.io.labels import FORMATS, read_labeling, write_labeling
from ldls.io.labels.label_formats import guess_format
from ldls.io.labels.labeling_npz import read_labeling_npz
from ldls.io.labels.nuscenes_labels import LIDARSEG, read_lidarseg, read_panoptic
from ldls.io.labels.semantic_kitti import read_semantic_kitti
from ldls.io.labels.squeezeseg import read_squeezeseg, read_squeezeseg_ranges
from ldls.labeling import Labeling


def class_names(found):
    return [found.names[c] for c in found.classes]


def range_image():
    image = np.zeros((64, 512, 6))
    image[0, :5, 4] = [10, 20, 0, 30, 40]
    image[0, :5, 5] = [1, 2, 1, 3, 0]
    return image


def test_squeezeseg_counts_pixels_with_a_range(tmp_path):
    np.save(tmp_path / "a.npy", range_image())
    found = read_squeezeseg(tmp_path / "a.npy")
    assert len(found) == 64 * 512
    assert class_names(found)[:5] == ["car", "pedestrian", "background", "cyclist", "background"]
    assert found.ignored[:5].tolist() == [False, False, True, False, False]
    assert found.ignored.sum() == 64 * 512 - 4
    assert read_squeezeseg_ranges(tmp_path / "a.npy")[:4].tolist() == [10, 20, 0, 30]


def test_a_range_that_is_a_signalling_nan_makes_no_warning(tmp_path):
    image = range_image().astype(np.float32)
    image.view(np.uint32)[0, 1, 4] = 0x7FA00000
    np.save(tmp_path / "a.npy", image)
    np.testing.assert_array_equal(read_squeezeseg_ranges(tmp_path / "a.npy")[:4], [10, np.nan, 0, 30])


def test_squeezeseg_predictions_are_labels_alone(tmp_path):
    labels = np.zeros((64, 512), np.uint8)
    labels[1, 0] = 3
    np.save(tmp_path / "a.npy", labels)
    found = read_squeezeseg(tmp_path / "a.npy")
    assert class_names(found)[512] == "cyclist"
    assert not found.ignored.any()
    assert read_squeezeseg_ranges(tmp_path / "a.npy") is None


def changed(value):
    image = range_image()
    image[0, 1, 5] = value
    return image


@pytest.mark.parametrize(
    ("content", "message"),
    [
        pytest.param(np.zeros((64, 512, 5)), "expected 64 x 512 x 6.*got \\(64, 512, 5\\)", id="five channels"),
        pytest.param(np.zeros((512, 64, 6)), "got \\(512, 64, 6\\)", id="turned"),
        pytest.param(changed(4), "point 1 has class 4.0, expected one of 0, 1, 2, 3", id="unknown label"),
        pytest.param(changed(1.5), "point 1 has class 1.5, expected one of", id="fraction"),
        pytest.param(changed(np.nan), "point 1 has class nan", id="nan"),
        pytest.param(np.full((64, 512), "x"), "expected numbers", id="text"),
    ],
)
def test_squeezeseg_faults(tmp_path, content, message):
    np.save(tmp_path / "a.npy", content)
    with pytest.raises(CorruptFileError, match=message):
        read_squeezeseg(tmp_path / "a.npy")


def test_squeezeseg_files_that_are_cut_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", range_image())
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:1000])
    with pytest.raises(TruncatedFileError, match="a.npy: .* needs 1572992 bytes, got 1000"):
        read_squeezeseg(tmp_path / "a.npy")


def test_squeezeseg_runs_no_code(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{}], object), allow_pickle=True)
    with pytest.raises(UnsafeFileError, match="object arrays"):
        read_squeezeseg(tmp_path / "a.npy")
    (tmp_path / "b.npy").write_bytes(b"")
    with pytest.raises(CorruptFileError, match="not a whole .npy"):
        read_squeezeseg(tmp_path / "b.npy")


def test_semantic_kitti_splits_its_halves(tmp_path):
    np.array([10 | 7 << 16, 0, 252 | 65535 << 16, 30, 99], "<u4").tofile(tmp_path / "a.label")
    found = read_semantic_kitti(tmp_path / "a.label")
    assert class_names(found) == ["car", "unlabeled", "moving-car", "person", "other-object"]
    assert found.instances.tolist() == [7, 0, 65535, 0, 0]


def test_semantic_kitti_faults(tmp_path):
    (tmp_path / "a.label").write_bytes(b"1234567")
    with pytest.raises(TruncatedFileError, match="7 bytes is not a multiple of 4"):
        read_semantic_kitti(tmp_path / "a.label")
    np.array([10, 12], "<u4").tofile(tmp_path / "a.label")
    with pytest.raises(CorruptFileError, match="a.label: point 1 has class 12"):
        read_semantic_kitti(tmp_path / "a.label")


def test_the_writer_and_the_reader_of_label_files_agree(small_scene, tmp_path):
    result = ldls.segment(*small_scene)
    ldls.save(result, tmp_path / "a.label")
    found = read_semantic_kitti(tmp_path / "a.label")
    np.testing.assert_array_equal(found.instances, np.maximum(result.labels, 0))
    expected = {0: "unlabeled", 1: "person", 3: "car"}
    assert class_names(found) == [expected[c] for c in result.categories.tolist()]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        pytest.param("car", "car", id="COCO's car under the id of its person"),
        pytest.param("vehicle.car", "car", id="nuScenes"),
        pytest.param("Pedestrian", "person", id="KITTI's person"),
        pytest.param("Cyclist", "bicyclist", id="KITTI's cyclist"),
        pytest.param("TRUCK", "truck", id="capitals"),
        pytest.param(" Stop Sign", "traffic-sign", id="capitals of a wider class, and a blank"),
        pytest.param("train", "on-rails", id="COCO's train"),
        pytest.param("moving-bus", "moving-bus", id="a name of its own"),
        pytest.param("stop sign", "traffic-sign", id="in a wider class"),
        pytest.param("gnome", "other-object", id="unknown"),
    ],
)
def test_classes_of_label_files_go_by_name(small_scene, tmp_path, name, expected):
    points, masks, camera = small_scene
    own = ldls.InstanceMasks.from_array(masks.to_array(), categories=[1, 2], names={1: name, 2: "person"})
    ldls.save(ldls.segment(points, own, camera), tmp_path / "a.label")
    assert set(class_names(read_semantic_kitti(tmp_path / "a.label"))) == {"unlabeled", expected, "person"}


def test_nuscenes(tmp_path):
    np.array([17, 2, 0, 24], np.uint8).tofile(tmp_path / "a_lidarseg.bin")
    found = read_lidarseg(tmp_path / "a_lidarseg.bin")
    expected = ["vehicle.car", "human.pedestrian.adult", "noise", "flat.driveable_surface"]
    assert class_names(found) == expected
    np.savez(tmp_path / "a_panoptic.npz", data=np.array([17001, 2999, 0, 24000], np.uint16))
    found = read_panoptic(tmp_path / "a_panoptic.npz")
    assert class_names(found) == expected
    assert found.instances.tolist() == [17001, 2999, 0, 0]


def test_names_of_the_lidarseg_challenge_are_kept(small_scene, tmp_path):
    points, masks, camera = small_scene
    for number, (name, held) in enumerate(LIDARSEG.items(), start=1):
        named = ldls.InstanceMasks.from_array(masks.to_array()[:1], categories=[number], names={number: name})
        result = ldls.segment(points, named, camera)
        assert (result.labels > 0).any()
        ldls.save(result, tmp_path / "a_lidarseg.bin")
        assert {*class_names(read_lidarseg(tmp_path / "a_lidarseg.bin"))} - {"noise"} <= {*held}, name


def test_nuscenes_faults(tmp_path):
    np.array([17, 32], np.uint8).tofile(tmp_path / "a_lidarseg.bin")
    with pytest.raises(CorruptFileError, match="point 1 has class 32"):
        read_lidarseg(tmp_path / "a_lidarseg.bin")
    np.savez(tmp_path / "a_panoptic.npz", data=np.array([32001], np.uint16))
    with pytest.raises(CorruptFileError, match="point 0 has class 32"):
        read_panoptic(tmp_path / "a_panoptic.npz")
    np.savez(tmp_path / "a_panoptic.npz", labels=np.array([1001], np.uint16))
    with pytest.raises(CorruptFileError, match="found arrays \\['labels'\\], expected 'data'"):
        read_panoptic(tmp_path / "a_panoptic.npz")
    (tmp_path / "a_panoptic.npz").write_bytes(b"PK")
    with pytest.raises(CorruptFileError, match="not a whole .npz"):
        read_panoptic(tmp_path / "a_panoptic.npz")


def test_segmentations_are_read_as_they_were_written(small_scene, tmp_path):
    points, masks, camera = small_scene
    result = ldls.segment(np.vstack([points, [[0, 0, -5]]]).astype(np.float32), masks, camera)
    ldls.save(result, tmp_path / "a.npz")
    found = read_labeling_npz(tmp_path / "a.npz")
    expected = {0: "background", 1: "person", 3: "car"}
    assert class_names(found) == [expected[c] for c in result.categories.tolist()]
    np.testing.assert_array_equal(found.instances, np.maximum(result.labels, 0))
    np.testing.assert_array_equal(found.ignored, result.labels < 0)
    assert found.ignored[-1]
    direct = Labeling.from_segmentation(result)
    for name in ("classes", "instances", "ignored"):
        np.testing.assert_array_equal(getattr(direct, name), getattr(found, name))


def tracked(result, *tracks):
    """The result with these tracks, one an instance."""
    moving = zip(result.instances, tracks, strict=True)
    return replace(result, instances=tuple(replace(i, track=t, velocity=(t / 4, -0.5)) for i, t in moving))


@pytest.mark.parametrize("tracks", [(7, 300), (9, 9), (0, 2)], ids=["each its own", "one of both", "one without"])
def test_instances_of_tracked_results_are_their_tracks_in_every_format(small_scene, tmp_path, tracks):
    result = tracked(ldls.segment(*small_scene), *tracks)
    expected = np.array([0, *tracks])[np.maximum(result.labels, 0)]
    for name in ("a.npz", "a.label", "b_panoptic.npz"):
        ldls.save(result, tmp_path / name)
    np.testing.assert_array_equal(Labeling.from_segmentation(result).instances, expected)
    np.testing.assert_array_equal(read_labeling(tmp_path / "a.npz").instances, expected)
    np.testing.assert_array_equal(read_labeling(tmp_path / "a.label").instances, expected)
    panoptic = read_labeling(tmp_path / "b_panoptic.npz")
    np.testing.assert_array_equal(panoptic.instances % 1000, expected)
    classes = {0: "noise", 1: "human.pedestrian.adult", 3: "vehicle.car"}
    assert class_names(panoptic) == [classes[c] for c in result.categories.tolist()]


def test_tracks_that_a_file_cannot_number_are_refused(small_scene, tmp_path):
    result = tracked(ldls.segment(*small_scene), 1000, 1)
    with pytest.raises(LimitError, match=r"a_panoptic.npz: track 1000, expected at most 999; track each scene alone"):
        ldls.save(result, tmp_path / "a_panoptic.npz")
    with pytest.raises(LimitError, match=r"a.label: a .label has 16 bits .*, got 65536"):
        ldls.save(tracked(result, 65536, 1), tmp_path / "a.label")
    assert list(tmp_path.iterdir()) == []


def test_two_masks_of_a_class_are_two_instances():
    found = Labeling.from_instance_labels(np.array([-1, 0, 1, 2, 3]), ["car", "person", "car"])
    assert class_names(found) == ["background", "background", "car", "person", "car"]
    assert found.instances.tolist() == [0, 0, 1, 2, 3]
    with pytest.raises(InputError, match="labels: got 4 to 4, expected -1 to 3"):
        Labeling.from_instance_labels(np.array([4]), ["car", "person", "car"])


def test_arrays_make_the_round_trip(tmp_path):
    source = labeling([0, 1, 2], [0, 4, 1], ignored=[0])
    write_labeling(tmp_path / "a.npz", source)
    found = read_labeling_npz(tmp_path / "a.npz")
    assert found.names == source.names
    for name in ("classes", "instances", "ignored"):
        np.testing.assert_array_equal(getattr(found, name), getattr(source, name))
    np.savez(tmp_path / "b.npz", classes=[0, 1], names=["background", "gnome"])
    assert class_names(read_labeling_npz(tmp_path / "b.npz")) == ["background", "gnome"]


@pytest.mark.parametrize(
    ("arrays", "error", "message"),
    [
        pytest.param({"x": [1]}, UnsupportedFormatError, "found arrays \\['x'\\]", id="neither kind"),
        pytest.param({"labels": [2], "object_name": ["car"]}, CorruptFileError, "expected -1 to 1", id="no object"),
        pytest.param(
            {"labels": [1], "object_name": ["car"], "object_track": [1, 2]},
            CorruptFileError,
            "a.npz: instance_ids: expected",
            id="tracks of others",
        ),
        pytest.param(
            {"labels": [1], "object_name": ["car"], "object_track": [-1]},
            CorruptFileError,
            "a.npz: instances: got -1",
            id="negative track",
        ),
        pytest.param({"labels": [0.5], "object_name": ["car"]}, CorruptFileError, "a.npz", id="float labels"),
        pytest.param({"classes": [2], "names": ["background"]}, CorruptFileError, "expected 0 to 0", id="class"),
        pytest.param({"classes": [0], "names": ["Car"]}, CorruptFileError, "'background' first", id="names"),
    ],
)
def test_arrays_that_do_not_fit(tmp_path, arrays, error, message):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(error, match=message):
        read_labeling_npz(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("name", "format"),
    [
        pytest.param("a_lidarseg.bin", "lidarseg", id="lidarseg"),
        pytest.param("a_panoptic.npz", "panoptic", id="panoptic"),
        pytest.param("a.npz", "npz", id="npz"),
        pytest.param("a.label", "label", id="label"),
        pytest.param("a.npy", "squeezeseg", id="npy"),
        pytest.param("a_LIDARSEG.Bin", "lidarseg", id="capitals"),
    ],
)
def test_endings_tell_formats(name, format):
    assert guess_format(name) == format


def test_what_no_ending_tells_is_asked_for(tmp_path):
    (tmp_path / "empty.txt").write_text("")
    with pytest.raises(UnsupportedFormatError, match="may be kitti-boxes or annotations; say which by format="):
        read_labeling(tmp_path / "empty.txt")
    with pytest.raises(UnsupportedFormatError, match="no format of labels has this name; expected npz"):
        read_labeling("a.bin")
    with pytest.raises(ParameterError, match="format: got 'kitti', expected one of npz"):
        read_labeling("a.txt", format="kitti")
    with pytest.raises(InputError, match="points: a.txt holds boxes"):
        read_labeling("a.txt", format="kitti-boxes")
    (tmp_path / "a.txt").write_text("1 Car\n")
    assert class_names(read_labeling(tmp_path / "a.txt", format="annotations")) == ["Car"]
    assert class_names(read_labeling(tmp_path / "a.txt")) == ["Car"]


@pytest.mark.parametrize("format", list(FORMATS))
def test_a_missing_file_stays_one(format, tmp_path, small_scene):
    points, _, camera = small_scene
    with pytest.raises(FileNotFoundError):
        read_labeling(tmp_path / "none", format=format, points=points, camera=camera)


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(np.array(["a"]), id="text"),
        pytest.param(np.array([1 + 2j]), id="complex numbers"),
        pytest.param(np.array(["2020-01-01"], "M8[D]"), id="dates"),
        pytest.param(np.array([1.5]), id="fractions"),
        pytest.param(np.array([[1001]]), id="a table"),
        pytest.param(np.array(1001), id="no axis"),
        pytest.param(np.array([-1001]), id="negative"),
        pytest.param(np.array([2**63], np.uint64), id="64 bits"),
        pytest.param(np.zeros(2, [("a", "<f4")]), id="fields"),
        pytest.param(np.array([True]), id="flags"),
    ],
)
def test_panoptic_arrays_of_other_kinds_are_corrupt(tmp_path, data):
    np.savez(tmp_path / "a_panoptic.npz", data=data)
    with pytest.raises(CorruptFileError, match=r"a_panoptic\.npz: "):
        read_panoptic(tmp_path / "a_panoptic.npz")
