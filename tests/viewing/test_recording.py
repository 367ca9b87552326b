"""Recordings hold what results say, at the right time; files are whole or not there."""

import io
import os
import re
import socket
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import rerun_cli
from PIL import Image
from rerun.error_utils import RerunWarning

import ldls
from batch import runs
from command import python
from conftest import pinhole
from ldls import stages
from ldls.explaining import rebuild
from ldls.labeling import Labeling
from ldls.palette import BACKGROUND, category_colour, instance_colours
from ldls.viewing import recording
from ldls.viewing.depth import depth_colours
from ldls.viewing.recording import Recording, open_recording, viewer
from ldls.viewing.recording.cameras import PIXEL_CENTRE, pinhole_of
from ldls.viewing.recording.session import check_target
from viewing.recorded import Recorded, rgb, vectors

IMAGE = np.random.default_rng(0).integers(0, 255, (60, 80, 3), dtype=np.uint8)
DARK = tuple(channel // 2 for channel in BACKGROUND)


@pytest.fixture
def result(small_scene):
    return ldls.segment(*small_scene, params=ldls.Params.paper())


@pytest.fixture
def truth(result):
    n = len(result.points)
    classes = np.where(np.arange(n) % 3 == 0, 2, 0)
    return Labeling(classes, (classes > 0) * (1 + np.arange(n) % 2), np.zeros(n, bool), ("background", "tree", "car"))


def recorded(path, result, **options):
    with open_recording(path) as made:
        made.add(result, **options)
    return Recorded(path)


def numbers(array):
    return array.to_numpy(zero_copy_only=False)


def test_the_docstring_names_every_entity(tmp_path, result, truth):
    rrd = recorded(tmp_path / "a.rrd", result, images={"camera 0": IMAGE}, truth=truth, diffusion=50)
    named = set(re.findall(r"^(?:world|diffusion)\S*", recording.__doc__, re.MULTILINE))
    there = {re.sub(r"statistics/.*", "statistics/...", path).replace(r"camera/camera\ 0", "camera/NAME")
             for path in rrd.entities}  # fmt: skip
    assert there == named
    statistics = {path.removeprefix("world/statistics/") for path in rrd.entities if "statistics" in path}
    assert statistics == {"confidence", "points/person", "points/car", *(f"milliseconds/{s}" for s in result.timings)}


def test_points_have_the_positions_colours_and_numbers_of_the_result(tmp_path, small_scene):
    points, masks, camera = small_scene
    strange = np.array([[np.nan, 0, 5], [0, np.inf, 5], [0, 0, -9]], np.float32)
    result = ldls.segment(np.vstack([points, strange]), masks, camera)
    row = recorded(tmp_path / "a.rrd", result).each("world/points")[0].values
    kept = np.isfinite(result.points).all(axis=1)
    np.testing.assert_array_equal(vectors(row["Points3D:positions"]), result.points[kept])
    np.testing.assert_array_equal(numbers(row["Points3D:class_ids"]), result.categories[kept])
    labels = result.labels[kept]
    np.testing.assert_array_equal(numbers(row["Points3D:keypoint_ids"]), np.where(labels < 0, 65535, labels))
    assert set(labels) == {-1, 0, 1, 2}
    by_label = {-1: DARK, 0: BACKGROUND} | dict(enumerate(map(tuple, instance_colours([1, 3]).tolist()), start=1))
    assert rgb(row["Points3D:colors"].to_pylist()) == [by_label[label] for label in labels.tolist()]


def test_direct_projection_has_the_labels_of_its_stage(tmp_path, result):
    row = recorded(tmp_path / "a.rrd", result).each("world/points/direct")[0].values
    expected = stages.direct_labels(result.pixels, result.masks)
    np.testing.assert_array_equal(numbers(row["Points3D:keypoint_ids"]), expected)
    np.testing.assert_array_equal(vectors(row["Points3D:positions"]), result.points[result.in_view])
    assert (expected != result.labels[result.in_view]).any(), "there is a difference to see"


def test_boxes_stand_where_the_objects_are(tmp_path, result):
    row = recorded(tmp_path / "a.rrd", result).each("world/boxes")[0].values
    boxes = [each.box for each in result.objects]
    assert row["Boxes3D:labels"].to_pylist() == ["person 1", "car 2"]
    np.testing.assert_allclose(vectors(row["Boxes3D:centers"]), [box.center for box in boxes], rtol=1e-6)
    np.testing.assert_allclose(2 * vectors(row["Boxes3D:half_sizes"]), [box.size for box in boxes], rtol=1e-6)
    x, y, z, w = vectors(row["Boxes3D:quaternions"], 4).T
    np.testing.assert_allclose(2 * np.arctan2(z, w), [box.yaw for box in boxes], rtol=1e-5)
    assert not x.any() and not y.any()


def test_names_and_colours_are_those_of_categories_and_instances(tmp_path, result):
    rrd = recorded(tmp_path / "a.rrd", result)
    person, car = (tuple(colour) for colour in instance_colours([1, 3]).tolist())
    assert rrd.names("world") == {
        (0, None): ("background", BACKGROUND), (0, 0): ("background", BACKGROUND), (0, 65535): ("out of view", DARK),
        (1, None): ("person", category_colour(1)), (1, 1): ("person 1", person),
        (3, None): ("car", category_colour(3)), (3, 2): ("car 2", car),
    }  # fmt: skip
    masks = rrd.names(r"world/camera/camera\ 0/image/masks")
    assert {of: info for (of, _), info in masks.items() if of} == {1: ("person 1", person), 2: ("car 2", car)}
    assert all(row.times == {} for row in rrd.each("world", "AnnotationContext:context")), "others are not shown"


def test_tracked_objects_keep_number_name_and_colour(tmp_path, two_sweeps):
    with open_recording(tmp_path / "a.rrd") as made:
        for number, each in enumerate(two_sweeps):
            made.add(each, images={"camera 0": IMAGE}, stamp=0.1 * number)
    rrd = Recorded(tmp_path / "a.rrd")
    assert rrd.timelines == {"frame", "time"}
    one, other = rrd.each("world/points")
    for field in ("positions", "colors", "class_ids", "keypoint_ids"):
        assert one.values[f"Points3D:{field}"].equals(other.values[f"Points3D:{field}"]), field
    assert {*numbers(one.values["Points3D:keypoint_ids"]).tolist()} == {0, 31, 300}
    boxes = [sorted(row.values["Boxes3D:labels"].to_pylist()) for row in rrd.each("world/boxes")]
    assert boxes == [["car 300, 5.0 m/s", "person 31"]] * 2
    masks = rrd.each(r"world/camera/camera\ 0/image/masks", "SegmentationImage:buffer")
    pixels = [row.values["SegmentationImage:buffer"][0].values.to_numpy().view(np.uint16) for row in masks]
    np.testing.assert_array_equal(*pixels)
    person, car = (tuple(colour) for colour in instance_colours([1, 3], [31, 300]).tolist())
    expected = {31: ("person 31", person), 300: ("car 300", car)}
    names = rrd.names(r"world/camera/camera\ 0/image/masks")
    assert {of: info for (of, _), info in names.items() if of} == expected
    assert {of: info for (_, of), info in rrd.names("world").items() if of in expected} == expected
    tables = [row.values["TextDocument:text"][0].as_py() for row in rrd.each("world/objects")]
    assert all("| 300 | car |" in table and "| 31 | person |" in table for table in tables)


def test_tracks_beyond_ids_are_refused(tmp_path, result):
    tracked = replace(result, instances=tuple(replace(each, track=65534 + each.label) for each in result.instances))
    with pytest.raises(ldls.LimitError, match="track 65535: recordings hold 0 to 65534"):
        recorded(tmp_path / "a.rrd", tracked)


def test_numbers_keep_their_meaning_from_frame_to_frame(tmp_path, small_scene):
    points, masks, camera = small_scene
    swapped = ldls.InstanceMasks.from_array([m.to_array() for m in masks], categories=[3, 1])
    with open_recording(tmp_path / "a.rrd") as made:
        for chosen in (masks, swapped, masks):
            made.add(ldls.segment(points, chosen, camera))
    rrd = Recorded(tmp_path / "a.rrd")
    names = {of: name for (of, _), (name, _) in rrd.names(r"world/camera/camera\ 0/image/masks").items()}
    shown = [
        [names[of] for of in np.unique(numbers(row.values["SegmentationImage:buffer"][0].values).view(np.uint8)) if of]
        for row in rrd.each(r"world/camera/camera\ 0/image/masks", "SegmentationImage:buffer")
    ]
    assert shown == [["person 1", "car 2"], ["car 1", "person 2"], ["person 1", "car 2"]]
    assert {name for name, _ in rrd.names("world").values()} >= {"person 1", "person 2", "car 1", "car 2"}


def test_of_masks_that_overlap_the_highest_label_shows(tmp_path, small_scene):
    points, _, camera = small_scene
    pixels = np.zeros((2, 60, 80), bool)
    pixels[0, 10:40, 10:40] = True
    pixels[1, 30:50, 30:60] = True
    masks = ldls.InstanceMasks.from_array(pixels, categories=[3, 3])
    row = recorded(tmp_path / "a.rrd", ldls.segment(points, masks, camera)).each(
        r"world/camera/camera\ 0/image/masks", "SegmentationImage:buffer"
    )[0]
    image = numbers(row.values["SegmentationImage:buffer"][0].values).reshape(60, 80)
    np.testing.assert_array_equal(image, np.where(pixels[1], 2, pixels[0]))


def test_images_and_their_points_are_there(tmp_path, result):
    rrd = recorded(tmp_path / "a.rrd", result, images={"camera 0": IMAGE})
    blob = rrd.last(r"world/camera/camera\ 0/image", "EncodedImage:blob")[0].as_py()
    with Image.open(io.BytesIO(bytes(blob))) as jpeg:
        assert jpeg.format == "JPEG" and jpeg.size == (80, 60)
    row = rrd.each(r"world/camera/camera\ 0/image/points")[0].values
    np.testing.assert_allclose(vectors(row["Points2D:positions"], 2), result.pixels + 0.5, rtol=1e-6)
    np.testing.assert_array_equal(numbers(row["Points2D:keypoint_ids"]), result.labels[result.in_view])


def test_the_table_and_the_curves_say_what_was_found(tmp_path, result):
    rrd = recorded(tmp_path / "a.rrd", result, name="000571")
    text = rrd.last("world/objects", "TextDocument:text")[0].as_py()
    assert text.startswith("# 000571\n") and "| n points | 500 |" in text
    for one in result.objects:
        assert f"| {one.label} | {one.name} | {one.score:.2f} | {one.n_points} |" in text
        assert rrd.last(f"world/statistics/points/{one.name}", "Scalars:scalars").to_pylist() == [one.n_points]
    mean = rrd.last("world/statistics/confidence", "Scalars:scalars")[0].as_py()
    assert mean == pytest.approx(result.confidence[result.labels > 0].mean())
    stage = rrd.last("world/statistics/milliseconds/graph", "Scalars:scalars")[0].as_py()
    assert stage == pytest.approx(result.timings["graph"] * 1e3)


def turned(angle):
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])


POSE = np.block([[turned(0.3), np.array([[0.2], [-0.1], [0.4]])], [np.zeros(3), 1]])
KITTI = np.array([[721.5, 0, 609.6, 44.9], [0, 721.5, 172.9, 0.22], [0, 0, 1, 0.0027]])


@pytest.mark.parametrize(
    "camera",
    [
        pytest.param(pinhole(), id="no transform"),
        pytest.param(ldls.Camera(projection=KITTI, T_camera_lidar=POSE), id="a last column, as KITTI's"),
        pytest.param(ldls.Camera(projection=7 * KITTI, T_camera_lidar=POSE), id="a homogeneous scale"),
        pytest.param(ldls.Camera(projection=KITTI[:, :3] @ turned(-0.2), T_camera_lidar=POSE), id="a rotation in it"),
        pytest.param(ldls.Camera(projection=[[700, 3, 600], [0, 710, 170], [0, 0, 1]]), id="skew"),
    ],
)
def test_pinholes_give_the_pixels_of_their_cameras(camera):
    points = np.random.default_rng(1).uniform([-4, -2, 3], [4, 2, 40], (300, 3))
    in_view, pixels = stages.project(points, camera, image_size=(375, 1242))
    assert len(in_view) > 20
    K, T_lidar_camera = pinhole_of(camera)
    assert np.allclose(K, np.triu(K)) and K[2, 2] == pytest.approx(1)
    rays = np.linalg.inv(T_lidar_camera) @ np.vstack([points[in_view].T, np.ones(len(in_view))])
    u, v, depth = K @ rays[:3]
    np.testing.assert_allclose(np.stack([u, v], axis=1) / depth[:, None], pixels + PIXEL_CENTRE, atol=1e-9)
    assert (depth > 0).all(), "they look along z"
    np.testing.assert_allclose(T_lidar_camera[:3, :3] @ T_lidar_camera[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_a_recorded_camera_is_that_pinhole(tmp_path, small_scene):
    points, masks, _ = small_scene
    camera = ldls.Camera(projection=KITTI, T_camera_lidar=POSE)
    row = recorded(tmp_path / "a.rrd", ldls.segment(points, masks, camera)).each(r"world/camera/camera\ 0")[0].values
    K, pose = pinhole_of(camera)
    columns = numbers(row["Pinhole:image_from_camera"].flatten()).reshape(3, 3)
    np.testing.assert_allclose(columns.T, K, rtol=1e-6)
    assert numbers(row["Pinhole:resolution"].flatten()).tolist() == [80, 60]
    np.testing.assert_allclose(vectors(row["Transform3D:translation"])[0], pose[:3, 3], rtol=1e-5)
    rotation = numbers(row["Transform3D:mat3x3"].flatten()).reshape(3, 3).T
    np.testing.assert_allclose(rotation, pose[:3, :3], atol=1e-6)


def test_a_distorted_lens_stands_as_a_pinhole_and_its_points_are_exact(tmp_path, small_scene):
    points, masks, _ = small_scene
    camera = pinhole(distortion=ldls.Distortion("plumb_bob", (-0.3, 0.1, 0, 0, 0)))
    result = ldls.segment(points, masks, camera)
    rrd = recorded(tmp_path / "a.rrd", result)
    columns = numbers(rrd.last(r"world/camera/camera\ 0", "Pinhole:image_from_camera").flatten()).reshape(3, 3)
    np.testing.assert_allclose(columns.T[:2, 2], [40.5, 30.5])
    uv = vectors(rrd.last(r"world/camera/camera\ 0/image/points", "Points2D:positions"), 2)
    np.testing.assert_allclose(uv, result.pixels + 0.5, rtol=1e-6)


@pytest.mark.parametrize("stamp", [1.7e12, 1.7e18, -1.7e18, np.nan, np.inf])
def test_stamps_that_are_no_seconds_are_refused(tmp_path, result, stamp):
    with open_recording(tmp_path / "a.rrd") as made:
        made.add(result, stamp=0.0)
        with pytest.raises(ldls.ParameterError, match="^stamp: got .*, expected seconds"):
            made.add(result, stamp=stamp)
        assert made.n_frames == 1
        made.add(result, stamp=9e9)
    rows = Recorded(tmp_path / "a.rrd").each("world/points", "Points3D:positions")
    assert [row.times["frame"] for row in rows] == [0, 1]


@pytest.mark.parametrize(
    ("stamps", "line", "expected"),
    [
        pytest.param((None,) * 3, None, None, id="no stamps"),
        pytest.param((0.0, 0.5, None), "time", [0, 500_000_000, None], id="a frame without"),
        pytest.param((0.0, 0.1, 0.25), "time", [0, 100_000_000, 250_000_000], id="from the start of a drive"),
        pytest.param((1.5e9, 1.5e9 + 0.5, 1.5e9 + 1), "time", [(1_500_000_000 * 2 + k) * 500_000_000 for k in range(3)],
                     id="dates"),
    ],
)  # fmt: skip
def test_frames_follow_one_another_on_their_timelines(tmp_path, result, stamps, line, expected):
    with open_recording(tmp_path / "a.rrd") as made:
        for stamp in stamps:
            made.add(result, stamp=stamp)
    rrd = Recorded(tmp_path / "a.rrd")
    assert rrd.timelines == {"frame", *([line] if line else [])}
    assert rrd.each("world/boxes")[-1].times.keys() == {"frame", *([line] if line and stamps[-1] else [])}
    rows = rrd.each("world/points", "Points3D:positions")
    assert [row.times["frame"] for row in rows] == [0, 1, 2]
    if line:
        assert [row.times.get(line) for row in rows] == expected


def test_what_a_later_frame_lacks_is_taken_away(tmp_path, result, truth):
    with open_recording(tmp_path / "a.rrd") as made:
        made.add(result, images={"camera 0": IMAGE}, truth=truth)
        made.add(result)
        made.add_frame(ldls.datasets.Frame(name="raw", points=result.points))
    rrd = Recorded(tmp_path / "a.rrd")
    gone = {path: [row.times["frame"] for row in rrd.each(path, "Clear:is_recursive")] for path in rrd.entities}
    assert {path: frames for path, frames in gone.items() if frames} == {
        "world/truth": [1], r"world/camera/camera\ 0/image": [1], r"world/camera/camera\ 0": [2],
        r"world/camera/camera\ 0/image/masks": [2], "world/points/direct": [2], "world/boxes": [2],
        "world/objects": [2],
    }  # fmt: skip


def test_diffusion_spreads_from_grey_to_the_labels(tmp_path, result):
    rrd = recorded(tmp_path / "a.rrd", result, diffusion=30, alone=True)
    rows = rrd.each("diffusion/points", "Points3D:colors")
    assert [row.times["iteration"] for row in rows] == [0, 30, 60, 90, 120, 150, 180, 200]
    assert set(rgb(rows[0].values["Points3D:colors"].to_pylist())) == {BACKGROUND}
    labels = result.diffused_labels[result.in_view]
    np.testing.assert_array_equal(numbers(rows[-1].values["Points3D:keypoint_ids"]), labels)
    (positions,) = rrd.each("diffusion/points", "Points3D:positions")
    np.testing.assert_array_equal(vectors(positions.values["Points3D:positions"]), result.points[result.in_view])
    assert rrd.each("world/points")[0].times == {"frame": 0, "iteration": 0}, "all is on the timeline that shows"
    assert rrd.views[-1][1] == "iteration" and rrd.views[-1][0]["diffusion"] == "diffusion"


def test_colours_of_the_diffusion_are_winners_by_their_share(tmp_path, result):
    row = recorded(tmp_path / "a.rrd", result, diffusion=30).each("diffusion/points", "Points3D:colors")[2].values
    system = rebuild(result)
    z = np.zeros(system.b.shape)
    for _ in range(60):
        z = system.A.astype(float) @ z + system.b.toarray()
    winner = z.argmax(axis=1)
    share = (z.max(axis=1) / z.sum(axis=1))[:, None]
    colours = np.vstack([[BACKGROUND], instance_colours([1, 3])])[winner]
    np.testing.assert_array_equal(numbers(row["Points3D:class_ids"]), np.array([0, 1, 3])[winner])
    expected = share * colours + (1 - share) * np.array(BACKGROUND)
    np.testing.assert_allclose(rgb(row["Points3D:colors"].to_pylist()), expected, atol=0.51)


def test_frames_after_a_diffusion_are_not_on_its_timeline(tmp_path, result):
    with open_recording(tmp_path / "a.rrd") as made:
        for _ in range(2):
            made.add(result, diffusion=100)
    rrd = Recorded(tmp_path / "a.rrd")
    assert [row.times for row in rrd.each("world/points")] == [{"frame": 0}, {"frame": 1}]
    rows = rrd.each("diffusion/points", "Points3D:colors")
    times = [(row.times["frame"], row.times["iteration"]) for row in rows]
    assert times == [(0, 0), (0, 100), (0, 200), (1, 0), (1, 100), (1, 200)]
    assert rrd.views[-1][1] == "frame"


@pytest.mark.parametrize("every", [0, -4, float("nan")])
def test_a_diffusion_of_no_steps_is_refused(result, every):
    with pytest.raises(ldls.errors.ParameterError, match="every"):
        Recording(rr.RecordingStream("test")).log_diffusion(result, every=every)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda p, m, c: (p, m.select([]), c), id="no masks"),
        pytest.param(lambda p, m, c: (p[:0], m, c), id="no points"),
        pytest.param(lambda p, m, c: (p * [1, 1, -1], m, c), id="no point in view"),
    ],
)
@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_empty_results_are_recorded_too(tmp_path, small_scene, change):
    result = ldls.segment(*change(*small_scene), params=ldls.Params.paper())
    rrd = recorded(tmp_path / "a.rrd", result, images={"camera 0": IMAGE}, diffusion=100)
    assert len(rrd.last("world/points", "Points3D:positions")) == len(result.points)
    assert len(rrd.last("world/boxes", "Boxes3D:centers")) == 0
    assert len(rrd.each("diffusion/points", "Points3D:colors")) == 3


def test_truth_has_its_own_names_and_boxes(tmp_path, result, truth):
    rrd = recorded(tmp_path / "a.rrd", result, truth=truth)
    row = rrd.each("world/truth", "Points3D:positions")[0].values
    np.testing.assert_array_equal(numbers(row["Points3D:class_ids"]), truth.classes)
    assert rrd.names("world/truth")[2, None] == ("car", category_colour(3))
    colours = rgb(row["Points3D:colors"].to_pylist())
    assert {colours[i] for i in np.flatnonzero(truth.classes == 2)} == {category_colour(3)}
    assert rrd.last("world/truth/boxes", "Boxes3D:labels").to_pylist() == ["car 1", "car 2"]
    short = replace_length(truth, 3)
    with pytest.raises(ldls.errors.InputError, match="3 labels, 500 points"):
        recorded(tmp_path / "b.rrd", result, truth=short)
    assert not (tmp_path / "b.rrd").exists()


def replace_length(truth, length):
    return Labeling(truth.classes[:length], truth.instances[:length], truth.ignored[:length], truth.names)


@pytest.mark.parametrize(
    ("images", "message"),
    [
        pytest.param({"1": IMAGE}, "no camera '1', expected camera 0", id="of no camera"),
        pytest.param({"camera 0": IMAGE[:50]}, r"expected uint8 \(60, 80, 3\)", id="of another size"),
        pytest.param({"camera 0": IMAGE / 255}, "float64", id="of another type"),
    ],
)
def test_wrong_images_are_refused(result, images, message):
    with pytest.raises(ldls.errors.InputError, match=message):
        Recording(rr.RecordingStream("test")).log_result(result, images=images)


def test_categories_beyond_the_ids_of_rerun_are_refused(small_scene):
    points, masks, camera = small_scene
    names = {70_000: "thing"}
    many = ldls.InstanceMasks.from_array(masks[0].to_array()[None], categories=[70_000], names=names)
    with pytest.raises(ldls.errors.LimitError, match="category 70000"):
        Recording(rr.RecordingStream("test")).log_result(ldls.segment(points, many, camera))


def test_a_result_goes_into_ones_own_recording_at_ones_own_time(tmp_path, result):
    with pytest.raises(ldls.errors.InputError, match=r"none is active; call rerun\.init"):
        Recording()
    stream = rr.RecordingStream("robot")
    stream.save(tmp_path / "own.rrd")
    with stream:
        own = Recording()
        rr.set_time("tick", sequence=7)
        own.log_result(result, entity="robot/front lidar")
        own.log_frame(ldls.datasets.Frame(name="f", points=result.points), entity="raw")
    stream.disconnect()
    rrd = Recorded(tmp_path / "own.rrd")
    assert rrd.recording.application_id == "robot"
    roots = {path.split("/")[0] for path in rrd.entities}
    assert roots == {"robot", "raw"}
    (row,) = rrd.each(r"robot/front\ lidar/points")
    assert row.times["tick"] == 7


def test_frames_without_masks_are_coloured_by_distance(tmp_path, result):
    image = ldls.datasets.CameraImage(name="front", camera=pinhole(image_size=(60, 80)), read=lambda: IMAGE)
    frame = ldls.datasets.Frame(name="f", points=result.points, images=(image,), stamp=3.0)
    with open_recording(tmp_path / "a.rrd") as made:
        made.add_frame(frame)
    rrd = Recorded(tmp_path / "a.rrd")
    below = {"points", "camera/front", "camera/front/image", "camera/front/image/points"}
    assert rrd.entities == {"world", *(f"world/{path}" for path in below)}
    xyz = result.points.astype(float)
    distance = rgb(rrd.last("world/points", "Points3D:colors").to_pylist())
    np.testing.assert_array_equal(distance, depth_colours(np.sqrt((xyz**2).sum(axis=1))))
    depth = rgb(rrd.last("world/camera/front/image/points", "Points2D:colors").to_pylist())
    np.testing.assert_array_equal(depth, depth_colours(xyz[result.in_view, 2]))
    uv = vectors(rrd.last("world/camera/front/image/points", "Points2D:positions"), 2)
    np.testing.assert_allclose(uv, result.pixels + 0.5, rtol=1e-6)
    assert set(rrd.views[-1][0]) == {"points", "front"}


def test_the_layout_shows_what_there_is(tmp_path, result, truth):
    views, timeline = recorded(tmp_path / "a.rrd", result).views[-1]
    assert views == {
        "points": "world", "direct projection": "world", "camera 0": r"world/camera/camera\ 0",
        "objects": "world/objects",
    }  # fmt: skip
    assert timeline == "frame"
    with open_recording(tmp_path / "b.rrd") as made:
        made.add(result)
        made.add(result, truth=truth)
    views, _ = Recorded(tmp_path / "b.rrd").views[-1]
    assert set(views) == {
        "points", "direct projection", "truth", "camera 0", "objects", "counts", "confidence", "times"
    }  # fmt: skip
    assert views["counts"] == "world/statistics/points" and views["times"] == "world/statistics/milliseconds"


def test_a_layout_can_be_sent_to_ones_own_recording(tmp_path, result):
    with rr.RecordingStream("robot") as stream:
        stream.save(tmp_path / "own.rrd")
        Recording(stream).log_result(result, entity="robot/lidar")
        stream.send_blueprint(recording.layout(recording.Contents(cameras=("camera 0",), entity="robot/lidar")))
    views, _ = Recorded(tmp_path / "own.rrd").views[-1]
    assert views == {
        "points": "robot/lidar",
        "direct projection": "robot/lidar",
        "camera 0": r"robot/lidar/camera/camera\ 0",
        "objects": "robot/lidar/objects",
    }


def test_a_file_is_whole_or_not_there(tmp_path, result):
    (tmp_path / "old.rrd").write_bytes(b"of yesterday")
    with pytest.raises(ZeroDivisionError), open_recording(tmp_path / "old.rrd") as made:
        made.add(result)
        raise ZeroDivisionError
    assert [path.name for path in tmp_path.iterdir()] == ["old.rrd"]
    assert (tmp_path / "old.rrd").read_bytes() == b"of yesterday"
    recorded(tmp_path / "old.rrd", result)
    assert [path.name for path in tmp_path.iterdir()] == ["old.rrd"]


FULL_DISK = """
import resource, signal, sys
import numpy as np
from ldls.datasets import Frame
from ldls.viewing.recording import open_recording

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
with open_recording(sys.argv[1]) as made:
    made.add_frame(Frame(name="f", points=np.random.default_rng(0).normal(size=(50_000, 3))))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="files have no limits of size there")
def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path):
    ended = python("-c", FULL_DISK, tmp_path / "a.rrd")
    assert ended.returncode == 1 and "OSError: [Errno 27]" in ended.stderr and "a.rrd" in ended.stderr
    assert list(tmp_path.iterdir()) == []


def test_files_that_cannot_be_written_are_named(tmp_path, result):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        recorded(tmp_path / "nowhere/a.rrd", result)


@pytest.mark.parametrize("target", ["", "a.npz", "rrd", "SPAWN"])
def test_targets_are_files_of_rerun_or_a_viewer(target):
    with pytest.raises(ldls.errors.ParameterError, match=r"expected spawn or a file that ends in \.rrd"):
        check_target(target)
    check_target("a.rrd")
    check_target("spawn")


@pytest.mark.parametrize(
    ("environment", "platform", "expected"),
    [
        pytest.param({}, "linux", False, id="a server"),
        pytest.param({"DISPLAY": ""}, "linux", False, id="an empty name"),
        pytest.param({"DISPLAY": ":0"}, "linux", True, id="X"),
        pytest.param({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True, id="Wayland"),
        pytest.param({}, "darwin", True, id="macOS"),
        pytest.param({}, "win32", True, id="Windows"),
    ],
)
def test_displays_are_seen(environment, platform, expected, no_display, monkeypatch):
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "platform", platform)
    assert viewer.has_display() is expected


@pytest.fixture
def no_viewer(no_display, monkeypatch):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        monkeypatch.setattr(viewer, "PORT", free.getsockname()[1])


def test_without_display_and_viewer_one_is_told_so_at_once(no_viewer, result, monkeypatch):
    # what starts a viewer waits for it to answer
    monkeypatch.setattr(rr.RecordingStream, "spawn", lambda *_, **__: pytest.fail("a viewer was started"))
    with pytest.raises(ConnectionError, match="no display to open a viewer on; name a file"):
        recorded("spawn", result)
    assert viewer.ANSWER_S <= 1


def test_what_listens_for_viewers_gets_all(tmp_path, no_viewer, result):
    # the program itself: the script of this name would leave it running when it is ended
    program = Path(rerun_cli.__file__).with_name("rerun.exe" if os.name == "nt" else "rerun")
    path = tmp_path / "received.rrd"
    command = [program, "--save", path, "--port", str(viewer.PORT)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as listener:
        try:
            runs.wait_for(viewer.is_open)
            with open_recording("spawn") as made:
                made.add(result)
            runs.wait_for(lambda: (rrd := received(path)) and LAST_LOGGED in rrd.entities)
        finally:
            listener.terminate()


LAST_LOGGED = "world/statistics/milliseconds/components"


def received(path):
    """The recording that a listener has written so far, which has no end yet; None where that cannot be read."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RerunWarning)
        try:
            return Recorded(path)
        except (ValueError, OSError, IndexError, RuntimeError):
            return None


def test_a_missing_library_is_named_with_its_extra(monkeypatch, tmp_path, result):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ImportError, match=r"pip install 'ldls\[viz\]'"):
        recorded(tmp_path / "a.rrd", result)
    with pytest.raises(ImportError, match=r"pip install 'ldls\[viz\]'"):
        Recording()


def test_a_street_with_its_diffusion_takes_few_megabytes(tmp_path, frame_571):
    result = ldls.segment(frame_571.points, frame_571.masks, frame_571.camera, params=ldls.Params.paper())
    image = ldls.read_image(frame_571.image_path)
    rrd = recorded(tmp_path / "a.rrd", result, images={"camera 0": image}, diffusion=4, alone=True)
    assert len(rrd.each("diffusion/points", "Points3D:colors")) == 51
    assert (tmp_path / "a.rrd").stat().st_size < 10e6
    np.testing.assert_array_equal(vectors(rrd.last("world/points", "Points3D:positions")), frame_571.points[:, :3])


def test_a_ring_has_all_its_cameras(tmp_path, data_folder):
    (frame,) = ldls.datasets.open_source(data_folder / "nuscenes", truth=False)
    boxes = ldls.datasets.read_boxes_2d(data_folder / "nuscenes")
    views = []
    for image in frame.images:
        rectangles = [box.ltrb_px for box in boxes[image.name]]
        masks = ldls.InstanceMasks.from_boxes(rectangles, image.camera.image_size, categories=[3] * len(rectangles))
        views.append(ldls.View(masks, image.camera, image.name))
    # boxes that cover one another make ties, which single precision may decide in another way
    result = ldls.segment(frame.points, views, params=ldls.Params.paper())
    images = {image.name: image.read() for image in frame.images}
    rrd = recorded(tmp_path / "a.rrd", result, images=images, stamp=frame.stamp, diffusion=100, alone=True)
    assert {path.split("/")[2] for path in rrd.entities if path.startswith("world/camera/")} == set(images)
    for seen in result.views:
        row = rrd.each(f"world/camera/{seen.view.name}/image/points")[0].values
        np.testing.assert_array_equal(numbers(row["Points2D:keypoint_ids"]), result.labels[seen.in_view])
    final = rrd.each("diffusion/points", "Points3D:keypoint_ids")[-1].values["Points3D:keypoint_ids"]
    np.testing.assert_array_equal(numbers(final), result.diffused_labels[result.in_view])
    assert {path.name for path in tmp_path.iterdir()} == {"a.rrd"}
