"""Labelled clouds and tables, read back by other readers."""

import csv
import json
import sys
from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls.camera.rigid import from_parts
from ldls.errors import PrecisionWarning
from ldls.palette import instance_colours


def segmented(scene, dtype=np.float32, shift=(0, 0, 0), **changes):
    points, masks, camera = scene
    camera = replace(camera, T_camera_lidar=from_parts(np.eye(3), -np.array(shift, float)))
    points = np.vstack([points, [[0, 0, -5]]]).astype(dtype) + np.array(shift, dtype)  # the last is out of view
    intensity = np.linspace(0, 1, len(points), dtype=dtype)
    return replace(ldls.segment(np.column_stack([points, intensity]), masks, camera), **changes)


def renamed(result, *names):
    found = zip(result.instances, names, strict=True)
    return replace(result, instances=tuple(replace(instance, name=name) for instance, name in found))


@pytest.fixture
def result(small_scene):
    return segmented(small_scene)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_pcd_files_open_elsewhere(small_scene, tmp_path, dtype):
    pypcd4 = pytest.importorskip("pypcd4", reason="the extra pcd is not installed")
    result = segmented(small_scene, dtype)
    ldls.save(result, tmp_path / "a.pcd")
    cloud = pypcd4.PointCloud.from_path(tmp_path / "a.pcd")
    assert cloud.fields == ("x", "y", "z", "intensity", "label", "instance", "confidence", "rgb")
    assert cloud.types == (*[dtype] * 4, np.uint32, np.uint32, np.float32, np.float32)
    np.testing.assert_array_equal(cloud.numpy(("x", "y", "z", "intensity")), result.points)
    np.testing.assert_array_equal(cloud.pc_data["label"], result.categories)
    np.testing.assert_array_equal(cloud.pc_data["instance"], np.maximum(result.labels, 0))
    np.testing.assert_array_equal(cloud.pc_data["confidence"], result.confidence)
    colours = pypcd4.PointCloud.decode_rgb(cloud.pc_data["rgb"])
    assert colours[-1].tolist() == [128, 128, 128]
    assert len({tuple(c) for c in colours[result.labels == 1]}) == 1
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "a.pcd"), result.points)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize(
    ("dtype", "shift"),
    [pytest.param(np.float32, (0, 0, 0), id="local"), pytest.param(np.float64, (5e5, 5.4e6, 200), id="UTM")],
)
def test_las_files_open_elsewhere(small_scene, tmp_path, suffix, dtype, shift):
    laspy = pytest.importorskip("laspy", reason="the extra las is not installed")
    result = segmented(small_scene, dtype, shift)
    assert (result.labels == 1).sum() > 50
    ldls.save(result, tmp_path / f"a{suffix}")
    las = laspy.read(tmp_path / f"a{suffix}")
    assert las.header.are_points_compressed == (suffix == ".laz")
    np.testing.assert_allclose(las.xyz, result.points[:, :3], rtol=0, atol=6e-5)
    np.testing.assert_allclose(np.asarray(las.intensity) / 65535, result.points[:, 3], rtol=0, atol=1e-5)
    np.testing.assert_array_equal(las.instance, np.maximum(result.labels, 0))
    np.testing.assert_array_equal(las.category, result.categories)
    np.testing.assert_array_equal(las.confidence, result.confidence)
    assert [las[name].dtype for name in ("instance", "category", "confidence")] == [np.uint32, np.uint16, np.float32]
    assert not np.asarray(las.classification).any()
    assert [int(las[c][-1]) for c in ("red", "green", "blue")] == [128 * 257] * 3
    np.testing.assert_array_equal(ldls.read_points(tmp_path / f"a{suffix}")[:, :3], las.xyz)


@pytest.mark.parametrize("largest", [2, 255, 256, 65535])
def test_las_keeps_larger_intensities_as_they_are(result, tmp_path, largest):
    laspy = pytest.importorskip("laspy", reason="the extra las is not installed")
    points = result.points.copy()
    points[:, 3] = np.linspace(0, largest, len(points)).round()
    ldls.save(replace(result, points=points), tmp_path / "a.las")
    np.testing.assert_array_equal(laspy.read(tmp_path / "a.las").intensity, points[:, 3])


@pytest.mark.parametrize(
    ("intensities", "held", "message"),
    [
        pytest.param([0.05, 0.5, 1.6], [0, 0, 2], "hold fractions, which are rounded, for", id="above 1"),
        pytest.param([0, 70_000], [0, 65535], "hold numbers above 65535, which are that, for", id="above 65535"),
        pytest.param([-1, 5], [0, 5], "hold numbers below 0, which are 0, for", id="below 0"),
        pytest.param([-1, 0.2], [0, 13107], "hold numbers below 0, which are 0, for", id="below 0 and to 1"),
        pytest.param([1, np.nan], [65535, 0], "hold NaN, which are 0, for", id="NaN"),
        pytest.param([np.nan, -7, 3], [0, 0, 3], "hold NaN, which are 0; numbers below 0, which are 0", id="two kinds"),
        pytest.param([9, np.inf, -np.inf], [9, 65535, 0], "below 0, .* above 65535", id="infinite"),
        pytest.param([np.nan], [0], "hold NaN", id="all NaN"),
    ],
)
def test_las_warns_of_intensities_that_it_cannot_hold(result, tmp_path, intensities, held, message):
    laspy = pytest.importorskip("laspy", reason="the extra las is not installed")
    points = result.points.copy()
    points[:, 3] = np.resize(intensities, len(points))
    with pytest.warns(PrecisionWarning, match=message) as warned:
        ldls.save(replace(result, points=points), tmp_path / "a.las")
    assert [warning.filename for warning in warned] == [__file__]
    assert "save .ply or .npz" in str(warned[0].message)
    np.testing.assert_array_equal(laspy.read(tmp_path / "a.las").intensity, np.resize(held, len(points)))


def test_las_rounds_fractions_of_large_intensities(result, tmp_path):
    laspy = pytest.importorskip("laspy", reason="the extra las is not installed")
    points = result.points.copy()
    points[:, 3] = np.linspace(0, 255, len(points))
    ldls.save(replace(result, points=points), tmp_path / "a.las")
    np.testing.assert_array_equal(laspy.read(tmp_path / "a.las").intensity, points[:, 3].round())


def test_las_says_what_it_cannot_hold(result, tmp_path):
    pytest.importorskip("laspy", reason="the extra las is not installed")
    points = result.points.copy()
    points[7, 1] = np.nan
    with pytest.raises(ldls.NonFiniteError, match=r"a.las: 1 of 501 points are not finite, the first in row 7"):
        ldls.save(replace(result, points=points), tmp_path / "a.las")
    points[7, 1] = 5e5
    with pytest.raises(ldls.LimitError, match="the cloud is 50000. m wide"):
        ldls.save(replace(result, points=points), tmp_path / "a.las")
    # too far from their middle, rounded, alone
    points[7:9, 1] = 214748.69, -214747.71
    with pytest.raises(ldls.LimitError, match="the cloud is 429496 m wide"):
        ldls.save(replace(result, points=points), tmp_path / "a.las")
    many = tuple(replace(instance, category=70_000) for instance in result.instances)
    with pytest.raises(ldls.LimitError, match="category ids 0 to 70000"):
        ldls.save(replace(result, instances=many), tmp_path / "a.las")
    assert list(tmp_path.iterdir()) == []


def test_parquet_files_are_tables(result, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra arrow is not installed")
    ldls.save(result, tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    for column, name in enumerate(("x", "y", "z", "intensity")):
        np.testing.assert_array_equal(table[name].to_numpy(), result.points[:, column])
    np.testing.assert_array_equal(table["label"].to_numpy(), result.labels)
    np.testing.assert_array_equal(table["instance"].to_numpy(), np.maximum(result.labels, 0))
    np.testing.assert_array_equal(table["category"].to_numpy(), result.categories)
    np.testing.assert_array_equal(table["confidence"].to_numpy(), result.confidence)
    expected = {-1: None, 0: None, 1: "person", 2: "car"}
    assert table["name"].to_pylist() == [expected[label] for label in result.labels.tolist()]
    about = json.loads(table.schema.metadata[b"ldls"])
    assert about["params"]["neighbors"] == 10
    assert about["version"] == ldls.__version__


def test_csv_files_are_tables(result, tmp_path):
    result = renamed(result, 'person, "tall"', "car")
    ldls.save(result, tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for column, name in enumerate(("x", "y", "z", "intensity")):
        np.testing.assert_array_equal(np.array([row[name] for row in rows], np.float32), result.points[:, column])
    assert [int(row["label"]) for row in rows] == result.labels.tolist()
    assert [int(row["instance"]) for row in rows] == np.maximum(result.labels, 0).tolist()
    assert [int(row["category"]) for row in rows] == result.categories.tolist()
    np.testing.assert_array_equal(np.array([row["confidence"] for row in rows], np.float32), result.confidence)
    assert {row["name"] for row in rows if row["label"] == "1"} == {'person, "tall"'}
    assert rows[-1]["name"] == ""
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "a.csv").astype(np.float32), result.points)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        pytest.param(("person", "car"), (2, 17), id="COCO"),
        pytest.param(("vehicle.trailer", "human.pedestrian.child"), (22, 3), id="its own names"),
        pytest.param(("Pedestrian", "Car"), (2, 17), id="KITTI"),
        pytest.param(("BUS", "Traffic Light"), (16, 28), id="capitals"),
        pytest.param(("toaster", "dog"), (29, 1), id="others"),
        pytest.param(("potted plant", "stop sign"), (30, 28), id="background"),
    ],
)
def test_lidarseg_files_are_nuscenes(result, tmp_path, names, expected):
    ldls.save(renamed(result, *names), tmp_path / "a_lidarseg.bin")
    classes = np.fromfile(tmp_path / "a_lidarseg.bin", np.uint8)
    np.testing.assert_array_equal(classes, np.array([0, *expected, 0])[result.labels])


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        pytest.param(("person", "car"), (2001, 17001), id="one of each"),
        pytest.param(("car", "car"), (17001, 17002), id="two of a class"),
    ],
)
def test_panoptic_files_are_nuscenes(result, tmp_path, names, expected):
    ldls.save(renamed(result, *names), tmp_path / "a_panoptic.npz")
    with np.load(tmp_path / "a_panoptic.npz") as stored:
        assert stored.files == ["data"]
        assert stored["data"].dtype == np.uint16
        np.testing.assert_array_equal(stored["data"], np.array([0, *expected, 0])[result.labels])


def test_panoptic_files_have_a_limit(result, tmp_path):
    crowded = replace(result, instances=result.instances[:1] * 1000)
    with pytest.raises(ldls.LimitError, match="1000 instances of human.pedestrian.adult, expected at most 999"):
        ldls.save(crowded, tmp_path / "a_panoptic.npz")


def test_nuscenes_files_are_what_the_evaluation_reads(result, tmp_path):
    from ldls.io.labels.nuscenes_labels import read_lidarseg, read_panoptic

    for ending, read in (("_lidarseg.bin", read_lidarseg), ("_panoptic.npz", read_panoptic)):
        ldls.save(result, tmp_path / f"a{ending}")
        assert len(read(tmp_path / f"a{ending}")) == len(result.labels)


@pytest.mark.parametrize("ending", [".pcd", ".las", ".laz", ".parquet", ".csv", "_lidarseg.bin", "_panoptic.npz"])
def test_an_empty_cloud_is_a_file_too(small_scene, tmp_path, ending):
    _, masks, camera = small_scene
    result = ldls.segment(np.zeros((0, 4), np.float32), masks, camera)
    ldls.save(result, tmp_path / f"a{ending}")
    if ending in (".pcd", ".las", ".laz", ".csv"):
        assert ldls.read_points(tmp_path / f"a{ending}").shape == (0, 4)


@pytest.mark.parametrize(
    ("suffix", "module", "extra"),
    [
        pytest.param(".pcd", "pypcd4", "pcd", id="PCD"),
        pytest.param(".las", "laspy", "las", id="LAS"),
        pytest.param(".laz", "lazrs", "las", id="LAZ"),
        pytest.param(".parquet", "pyarrow", "arrow", id="Parquet"),
    ],
)
def test_missing_libraries_name_their_extra(result, tmp_path, monkeypatch, suffix, module, extra):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf"ldls\[{extra}\]"):
        ldls.save(result, tmp_path / f"a{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def places(result):
    """A map of the result: a person of track 7 and a car of track 5."""
    instances = tuple(replace(i, track=track) for i, track in zip(result.instances, (7, 5), strict=True))
    drawn = ldls.LabelledMap(0.1)
    sweep = ldls.Sweep(result.points, [], from_parts(np.eye(3), [5e5, 5.4e6, 0]), 0.0)
    drawn.add(sweep, replace(result, instances=instances))
    return drawn


def test_maps_are_clouds(places, tmp_path):
    pypcd4 = pytest.importorskip("pypcd4", reason="the extra pcd is not installed")
    laspy = pytest.importorskip("laspy", reason="the extra las is not installed")
    assert set(zip(places.categories.tolist(), places.tracks.tolist(), strict=True)) == {(0, 0), (1, 7), (3, 5)}
    for ending in ("ply", "pcd", "las", "LAZ"):
        ldls.save(places, tmp_path / f"a.{ending}")
        found = ldls.read_points(tmp_path / f"a.{ending}")[:, :3]
        np.testing.assert_allclose(found, places.points, rtol=0, atol=6e-5 if ending in ("las", "LAZ") else 0)
    cloud = pypcd4.PointCloud.from_path(tmp_path / "a.pcd")
    assert cloud.fields == ("x", "y", "z", "label", "instance", "confidence", "rgb")
    las = laspy.read(tmp_path / "a.las")
    assert las.header.are_points_compressed is False
    for categories, tracks, confidence, colours in (
        (*(cloud.pc_data[name] for name in ("label", "instance", "confidence")), decoded(pypcd4, cloud)),
        (las.category, las.instance, las.confidence, np.stack([las.red, las.green, las.blue], axis=1) // 257),
    ):
        np.testing.assert_array_equal(categories, places.categories)
        np.testing.assert_array_equal(tracks, places.tracks)
        np.testing.assert_array_equal(confidence, places.confidence)
        for track, category in ((0, None), (7, 1), (5, 3)):
            expected = [128] * 3 if category is None else instance_colours([category], [track])[0].tolist()
            assert {tuple(each) for each in colours[places.tracks == track].tolist()} == {tuple(expected)}


def decoded(pypcd4, cloud):
    return np.asarray(pypcd4.PointCloud.decode_rgb(cloud.pc_data["rgb"]), int)


def test_maps_have_no_other_formats_and_no_options(places, tmp_path):
    with pytest.raises(ldls.UnsupportedFormatError, match=r"cannot write '.npz' maps, expected .ply, .pcd"):
        ldls.save(places, tmp_path / "a.npz")
    with pytest.raises(ldls.ParameterError, match=r"image_id: no option of .ply maps"):
        ldls.save(places, tmp_path / "a.ply", image_id=1)
    ldls.save(ldls.LabelledMap(), tmp_path / "empty.ply")
    assert ldls.read_points(tmp_path / "empty.ply").shape == (0, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["empty.ply"]
