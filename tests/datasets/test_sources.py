"""Every source on a small layout of its own, and what is said where something is missing."""

import json
import os
import pickle
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ldls
from datasets import layouts
from ldls.datasets import SOURCES, Frame, open_source, read_boxes_2d
from ldls.errors import LeftOutWarning
from ldls.stages import project

WRITERS = {
    "kitti-object": layouts.kitti_object,
    "kitti-raw": layouts.kitti_raw,
    "kitti-odometry": layouts.kitti_odometry,
    "nuscenes": layouts.nuscenes,
    "folder": layouts.plain_folder,
}


def n_in_view(frame: Frame, camera=0):
    image = frame.images[camera]
    return len(project(frame.points, image.camera, image_size=image.camera.image_size)[0])


@pytest.mark.parametrize("kind", WRITERS)
def test_a_source_yields_frames_with_points_camera_and_image(tmp_path, kind):
    source = open_source(WRITERS[kind](tmp_path))
    assert source.kind == kind
    frames = list(source)
    assert [frame.name for frame in frames] == list(source.names)
    assert len(source) == len(frames) == len(source.stamps)
    for frame in frames:
        assert frame.points[:, :3].tolist() == layouts.cloud()[:, :3].tolist()
        assert frame.images[0].camera.image_size == layouts.SIZE
        assert frame.images[0].read().shape == (*layouts.SIZE, 3)
        assert n_in_view(frame) == 50
    with pytest.raises(IndexError):
        source[len(source)]


@pytest.mark.parametrize("kind", WRITERS)
def test_a_source_names_cameras_and_files_without_reading_a_frame(tmp_path, kind):
    source = open_source(WRITERS[kind](tmp_path))
    for index, frame in enumerate(source):
        assert source.camera_names == tuple(image.name for image in frame.images)
        files = source.files(index)
        assert all(path.is_file() for path in files)
        assert {image.path for image in frame.images} < set(files)


def folder_with_files_of_cameras(folder):
    layouts.kitti_object(folder, frames=("a", "b"))
    layouts.kitti_raw(folder, n_frames=0)
    cameras = {
        "front": 'calibration = "calib/{frame}.txt"\nstamps = "front/stamps.txt"',
        "left": f'K = {layouts.K.tolist()}\nT_camera_lidar = "T.txt"',
        "back": 'calibration = "2011_09_26"',
    }
    tables = (f'[cameras.{name}]\nimages = "front/{{frame}}.png"\n{keys}\n' for name, keys in cameras.items())
    layouts.plain_folder(folder, "\n".join(['points = "lidar/{frame}.bin"', 'stamps = "stamps.txt"', *tables]))
    layouts.write_text(folder / "front/stamps.txt", "a 0.0\nb 0.1\n")
    layouts.write_text(folder / "T.txt", layouts.row(layouts.T))
    return folder / "ldls.toml"


@pytest.mark.parametrize(
    "write",
    [
        *(pytest.param(write, id=kind) for kind, write in WRITERS.items()),
        pytest.param(folder_with_files_of_cameras, id="folder with files of its cameras"),
    ],
)
def test_all_that_is_read_is_a_file_of_the_frame(tmp_path, write, monkeypatch):
    folder = write(tmp_path)
    opened = set()

    def noted(path, *arguments, before=os.open, **options):
        opened.add(Path(path))
        return before(path, *arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", noted)
        source = open_source(folder, truth=False)
        for image in source[0].images:
            image.read()
    assert opened == set(source.files(0))


@pytest.mark.parametrize("kind", WRITERS)
def test_a_source_travels_between_processes(tmp_path, kind):
    source = open_source(WRITERS[kind](tmp_path))
    arrived = pickle.loads(pickle.dumps(source))
    assert (arrived.names, arrived.files(1)) == (source.names, source.files(1))
    np.testing.assert_array_equal(arrived[1].points, source[1].points)


@pytest.mark.parametrize("kind", WRITERS)
def test_frames_are_read_only_when_they_are_asked_for(tmp_path, kind):
    path = WRITERS[kind](tmp_path)
    source = open_source(path)
    second = source[1]
    second.images[0].path.unlink()
    assert len(source[0].points) == 100
    with pytest.raises(FileNotFoundError, match=re.escape(second.images[0].path.name)):
        second.images[0].read()


@pytest.mark.parametrize(
    ("kind", "deeper"),
    [
        pytest.param("kitti-object", "training", id="parent of training"),
        pytest.param("kitti-raw", None, id="folder of a day"),
        pytest.param("kitti-odometry", None, id="parent of sequences"),
    ],
)
def test_the_parent_of_the_only_one_will_do(tmp_path, kind, deeper):
    path = WRITERS[kind](tmp_path / deeper if deeper else tmp_path)
    parents = {"kitti-object": tmp_path, "kitti-raw": path.parent, "kitti-odometry": tmp_path}
    assert open_source(parents[kind]).path == path


def test_stamps_of_a_raw_drive_are_read_to_the_nanosecond_that_a_float_holds(tmp_path):
    frame = open_source(layouts.kitti_raw(tmp_path))[1]
    assert frame.stamp == pytest.approx(1317042146.951199337, abs=3e-7)
    assert frame.images[0].stamp - frame.stamp == pytest.approx(-0.01, abs=1e-6)


def test_a_raw_drive_leaves_out_frames_that_lack_a_file(tmp_path):
    drive = layouts.kitti_raw(tmp_path, n_frames=4)
    (drive / "velodyne_points/data/0000000001.bin").unlink()
    source = open_source(drive)
    assert source.names == ("0000000000", "0000000002", "0000000003")
    assert source.left_out == {"0000000001": "no velodyne_points"}
    assert source[1].stamp == pytest.approx(1317042147.951199, abs=1e-6), "a stamp is that of its number"
    (drive / "image_02/data/0000000003.png").unlink()
    with pytest.warns(LeftOutWarning, match="1 of 3 sweeps are left out: 1 no image_02"):
        assert len(open_source(drive)) == 2


def test_frames_are_in_the_order_of_their_numbers(tmp_path):
    names = [str(number) for number in range(12)]
    assert open_source(layouts.plain_folder(tmp_path / "folder", frames=names)).names == tuple(names)
    frames = layouts.kitti_object(tmp_path / "kitti", frames=names)
    for name in ("10", "2"):
        (frames / f"calib/{name}.txt").unlink()
    with pytest.warns(LeftOutWarning, match="2 of 12 sweeps"):
        source = open_source(frames)
    assert source.names == tuple(name for name in names if name not in ("2", "10"))
    assert list(source.left_out) == ["2", "10"]


def way(n, step_m=0.5):
    """A lidar that goes ahead and turns to the left."""
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, 0, 3] = step_m * np.arange(n)
    poses[:, :3, :3] = Rotation.from_euler("z", 3 * np.arange(n)[:, None], degrees=True).as_matrix()
    return poses


IMU_M = np.array([-0.8, 0.3, -0.8])
"""Where the IMU is, from the lidar."""


def with_oxts(drive, n=3, later_s=0.2):
    """Measurements a second apart, as sweeps are, but so much later."""
    clock = [f"2011-09-26 13:02:{25.951199337 + later_s + k:.9f}\n" for k in range(n)]
    T_lidar_imu = np.eye(4)
    T_lidar_imu[:3, 3] = IMU_M
    return layouts.oxts(drive, way(n), T_lidar_imu, clock)


def test_poses_of_a_raw_drive_are_those_at_the_stamps_of_its_sweeps(tmp_path):
    drive = layouts.kitti_raw(tmp_path)
    assert open_source(drive)[0].pose is None
    with_oxts(drive)
    frame = pickle.loads(pickle.dumps(open_source(drive)))[1]
    assert frame.pose[:3, 3] == pytest.approx([0.4, 0, 0] - IMU_M, abs=1e-4)
    assert np.degrees(np.arctan2(frame.pose[1, 0], frame.pose[0, 0])) == pytest.approx(2.4, abs=1e-4)
    # before the first one its motion goes on
    assert open_source(drive)[0].pose[0, 3] == pytest.approx(-0.1 - IMU_M[0], abs=1e-4)
    (drive.parent / "calib_imu_to_velo.txt").unlink()
    assert open_source(drive)[1].pose is None


AHEAD, LEFT, RIGHT, BEHIND_LEFT = [5, 0, 0], [0, 5, 0], [0, -5, 0], [-5, 1e-6, 0]


def test_points_of_a_raw_drive_have_times_by_their_azimuth(tmp_path):
    drive = layouts.kitti_raw(tmp_path)
    assert open_source(drive)[1].times is None
    points = np.ones((5, 4), "<f4")
    points[:4, :3], points[4, 0] = [AHEAD, LEFT, RIGHT, BEHIND_LEFT], np.nan
    layouts.write_points(drive / "velodyne_points/data/0000000001.bin", points)
    frame = open_source(layouts.turns(drive))[1]
    assert frame.times.dtype == np.float64
    np.testing.assert_allclose(frame.times[:4], [0, -0.02, 0.03, -0.04], atol=1e-6)
    # the lidar goes 5 m/s ahead, and a point to the left is seen before it has come to where it is at the stamp
    way = ldls.Trajectory(
        [frame.stamp - 1, frame.stamp], [np.eye(4), np.eye(4) + 5 * np.eye(4)[[0]].T @ np.eye(4)[[3]]]
    )
    moved = frame.deskewed(way).points
    np.testing.assert_allclose(moved[:3, 0], [5, -0.1, 0.15], atol=1e-5)
    assert np.array_equal(frame.deskewed(way).images[0].camera.T_camera_lidar, layouts.T), "the lidar fires the camera"
    for name in ("start", "end"):
        path = drive / f"velodyne_points/timestamps_{name}.txt"
        text = path.read_text()
        path.write_text(text.replace(text.splitlines()[1], ""))
        source = open_source(drive)
        assert source[1].times is None and source[2].times is not None, "what was not measured has no time"
        path.unlink()
        assert open_source(drive)[2].times is None
        path.write_text(text)


@pytest.mark.parametrize(("before_s", "after_s"), [(-0.01, 0.05), (0.05, -0.01), (0.5, 0.6)])
def test_a_sweep_that_begins_after_its_stamp_or_never_ends_is_an_error_that_says_so(tmp_path, before_s, after_s):
    drive = layouts.turns(layouts.kitti_raw(tmp_path), before_s=before_s, after_s=after_s)
    expected = rf"frame 0000000000 begins \{-before_s:+.3f}\d+ s and ends \{after_s:+.3f}\d+ s from its stamp"
    with pytest.raises(ldls.CorruptFileError, match=expected):
        open_source(drive)[0]


def test_times_and_the_poses_around_them_are_files_of_a_frame(tmp_path):
    drive = layouts.kitti_raw(tmp_path, n_frames=5)
    with_oxts(drive, n=5, later_s=0.0)
    ahead = lambda: [p.name for p in open_source(drive).files(3) if p.parent.parent.name == "oxts"]  # noqa: E731
    assert ahead() == ["0000000000.txt", "0000000002.txt", "0000000003.txt"]
    layouts.turns(drive, n_frames=5)
    assert ahead() == ["0000000000.txt", "0000000002.txt", "0000000003.txt", "0000000004.txt"]
    names = [path.name for path in open_source(drive).files(3)]
    assert {"timestamps_start.txt", "timestamps_end.txt"} <= set(names)


def test_cameras_of_nuscenes_are_not_moved_again(tmp_path):
    frame = open_source(layouts.nuscenes(tmp_path))[0]
    way = ldls.Trajectory([frame.stamp - 0.5, frame.stamp], [np.eye(4), np.eye(4) + np.eye(4)[[0]].T @ np.eye(4)[[3]]])
    for was, image in zip(frame.images, frame.deskewed(way).images, strict=True):
        assert np.array_equal(was.camera.T_camera_lidar, image.camera.T_camera_lidar)


def test_a_sweep_beyond_the_poses_of_its_drive_is_an_error_with_its_name(tmp_path):
    drive = layouts.kitti_raw(tmp_path)
    with_oxts(drive, n=2)
    source = open_source(drive)
    assert source[1].pose is not None
    with pytest.raises(
        ldls.PoseError, match="drive_0001_sync, pose of frame 0000000002: stamp: no pose at 1317042147.95"
    ):
        source[2]


@pytest.mark.parametrize("file", ["08/poses.txt", "../poses/08.txt"])
def test_poses_of_odometry_are_those_of_the_lidar(tmp_path, file):
    sequence = layouts.kitti_odometry(tmp_path)
    assert open_source(sequence)[0].pose is None
    of_camera = layouts.T @ way(3) @ np.linalg.inv(layouts.T)
    layouts.write_text(sequence.parent / file, "".join(layouts.row(pose[:3]) + "\n" for pose in of_camera))
    (sequence / "velodyne/000001.bin").unlink()
    first, last = open_source(sequence)
    np.testing.assert_allclose([first.pose, last.pose], way(3)[[0, 2]], atol=1e-8)
    (sequence / "times.txt").unlink()
    assert open_source(sequence)[0].pose is None


def test_poses_of_nuscenes_are_those_of_the_lidar_on_the_car(tmp_path):
    first, second = open_source(layouts.nuscenes(tmp_path))
    expected = np.eye(4)
    expected[:3, 3] = [5, 0, 1.8]
    np.testing.assert_allclose(second.pose, expected, atol=1e-9)
    assert first.pose[0, 3] == 0
    without = open_source(tmp_path, poses=False)[1]
    assert without.pose is None
    np.testing.assert_array_equal(without.images[0].camera.T_camera_lidar, second.images[0].camera.T_camera_lidar)


@pytest.mark.parametrize(
    ("kind", "change", "error", "message"),
    [
        pytest.param("kitti-raw", lambda d: (with_oxts(d) / "data/0000000001.txt").write_text("49 8 0\n"),
                     ldls.TruncatedFileError, "oxts/data/0000000001.txt: line 1", id="a broken measurement"),
        pytest.param("kitti-raw", lambda d: (with_oxts(d) / "timestamps.txt").unlink(), FileNotFoundError,
                     "timestamps.txt", id="measurements without stamps"),
        pytest.param("kitti-odometry", lambda d: layouts.write_text(d / "poses.txt", "1 0 0 0\n" * 3),
                     ldls.CorruptFileError, "poses.txt: line 1: expected at least 12", id="half a pose"),
        pytest.param("kitti-odometry", lambda d: layouts.write_text(d / "poses.txt", layouts.row(np.eye(4)[:3]) + "\n"),
                     ldls.PoseError, "poses.txt: has 1 poses for 3 stamps", id="fewer poses than times"),
        pytest.param("kitti-odometry", lambda d: layouts.write_text(d / "poses.txt", "".join(
                         layouts.row(pose[:3]) + "\n" for pose in way(3, step_m=11))),
                     ldls.PoseError, "poses.txt: poses: from 0.000000 to 0.100000 s the lidar moves 11 m", id="a jump"),
    ],
)  # fmt: skip
def test_broken_poses_of_a_drive_are_named(tmp_path, kind, change, error, message):
    path = WRITERS[kind](tmp_path)
    change(path)
    with pytest.raises(error, match=message):
        open_source(path)


def test_truth_of_odometry_is_that_of_its_labels(tmp_path):
    frame = open_source(layouts.kitti_odometry(tmp_path))[0]
    assert frame.truth.counts()["car"] == 50 and set(frame.truth.instances) == {0, 7}
    assert frame.stamp == 0
    assert open_source(tmp_path, truth=False)[0].truth is None


def test_truth_of_kitti_is_its_annotations_before_its_boxes(tmp_path):
    folder = layouts.kitti_object(tmp_path)
    box = "Car 0 0 0 0 0 80 60 4 5 5 0 2 10 0\n"
    layouts.write_text(folder / "label_2/000000.txt", box)
    assert open_source(folder)[0].truth.counts()["Car"] > 40
    with pytest.raises(ldls.SourceError, match="no folder annotations, but label_2; take it by truth=kitti-boxes$"):
        open_source(folder, truth="annotations")
    layouts.write_text(folder / "annotations/000000.txt", "1 Pedestrian\n" * 100)
    assert open_source(folder)[0].truth.counts()["Pedestrian"] == 100
    assert open_source(folder)[1].truth is None
    with pytest.warns(LeftOutWarning, match="2 of 3 sweeps are left out: 2 no label_2"):
        (frame,) = open_source(folder, truth="kitti-boxes")
    assert frame.truth.counts()["Car"] > 40


def test_with_stored_masks_kitti_needs_no_images(tmp_path):
    folder = layouts.kitti_object(tmp_path)
    pixels = np.zeros((1, *layouts.SIZE), bool)
    masks = ldls.InstanceMasks.from_array(pixels, categories=[1], scores=[1])
    (folder / "masks").mkdir()
    for k in range(3):
        ldls.save(masks, folder / f"masks/00000{k}.json")
    image = open_source(folder, masks="masks")[0].images[0]
    assert image.masks.image_size == image.camera.image_size == layouts.SIZE and image.read().shape[:2] == layouts.SIZE
    shutil.rmtree(folder / "image_2")
    image = open_source(folder, masks="masks")[0].images[0]
    assert image.camera.image_size == layouts.SIZE
    with pytest.raises(FileNotFoundError, match="image_2"):
        image.read()
    with pytest.raises(ldls.ParameterError, match="masks: got 'masks' for 2 cameras"):
        open_source(folder, masks="masks", camera=(2, 3))
    expected = "true, false, annotations or kitti-boxes"
    with pytest.raises(ldls.ParameterError, match=f"truth: got 'guess', expected {expected}"):
        open_source(folder, masks="masks", truth="guess")


def test_nuscenes_contains_the_way_of_the_car_between_the_stamps(tmp_path):
    source = open_source(layouts.nuscenes(tmp_path))
    frame = source[0]
    assert [image.name for image in frame.images] == list(layouts.CHANNELS)
    assert frame.images[0].stamp - frame.stamp == pytest.approx(-0.02, abs=1e-6)
    # the camera was 0.2 m farther back when it took the image
    expected = layouts.T.copy()
    expected[2, 3] = 0.2
    assert frame.images[0].camera.T_camera_lidar == pytest.approx(expected, abs=1e-9)
    assert frame.truth.counts()["vehicle.car"] == 100
    assert frame.points.shape == (100, 5)


def test_a_scene_of_nuscenes_is_chosen_by_name(tmp_path):
    layouts.nuscenes(tmp_path, scenes=("scene-0001", "scene-0002"))
    assert len(open_source(tmp_path)) == 4
    source = open_source(tmp_path, scene="scene-0002")
    assert source.names == ("scene-0002_000", "scene-0002_001")
    with pytest.raises(ldls.SourceError, match="no scene 'scene-0003'; found scene-0001, scene-0002"):
        open_source(tmp_path, scene="scene-0003")


def test_stamps_of_a_folder_may_have_comments_and_blank_lines(tmp_path):
    layouts.plain_folder(tmp_path)
    layouts.write_text(tmp_path / "stamps.txt", "# frame seconds\n\na 1.5\n#b 7.0\n\nb 1.6\n\n")
    assert open_source(tmp_path).stamps == (1.5, 1.6)
    for part in tmp_path.rglob("a.*"):
        part.rename(part.with_stem("#a"))
    layouts.write_text(tmp_path / "stamps.txt", "#a 1.5\nb 1.6\n")
    assert open_source(tmp_path).stamps == (1.5, 1.6)


def test_folder_has_distortion_stamps_and_masks(tmp_path):
    folder = layouts.plain_folder(tmp_path)
    pixels = np.zeros((1, *layouts.SIZE), bool)
    (folder / "masks").mkdir()
    ldls.save(ldls.InstanceMasks.from_array(pixels, categories=[1], scores=[1]), folder / "masks/b.npz")
    source = open_source(folder)
    assert source.names == ("a", "b") and source.stamps == (0.0, 0.1)
    assert source[0].images[0].camera.distortion.model == "plumb_bob"
    assert source[1].images[0].masks.image_size == layouts.SIZE
    assert source[0].images[0].masks is None


def test_the_template_describes_a_folder(tmp_path):
    from ldls.datasets.folder import TEMPLATE as description

    layouts.kitti_object(tmp_path / "kitti", frames=("a",))
    layouts.write_text(tmp_path / "ldls.toml", description)
    layouts.write_points(tmp_path / "lidar/a.bin")
    layouts.write_points(tmp_path / "labels/a.label", np.full(100, 10, "<u4"))
    layouts.write_image(tmp_path / "front/a.png", (480, 640))
    layouts.write_image(tmp_path / "left/a.png")
    layouts.write_image(tmp_path / "right/a.png")
    layouts.write_text(tmp_path / "right.yaml", "K: [50, 0, 40, 0, 50, 30, 0, 0, 1]\nD: []\n")
    shutil.copytree(tmp_path / "kitti/calib", tmp_path / "calib")
    for stamps in ("lidar/stamps.txt", "front/stamps.txt"):
        layouts.write_text(tmp_path / stamps, "a 12.5\n")
    frame = open_source(tmp_path)[0]
    assert [image.name for image in frame.images] == ["front", "left", "right"]
    # the pose of a body without a turn: its inverse, then the turn to the optical frame
    back = [[0, -1, 0, -0.2], [0, 0, -1, 0], [1, 0, 0, -0.1], [0, 0, 0, 1]]
    np.testing.assert_allclose(frame.images[2].camera.T_camera_lidar, back)
    assert frame.images[0].camera.image_size == (480, 640) and frame.images[1].camera.image_size == layouts.SIZE
    assert frame.stamp == frame.images[0].stamp == 12.5 and frame.images[1].stamp is None
    assert frame.truth.counts()["car"] == 100


def test_a_size_of_an_image_that_its_calibration_contradicts_is_refused(tmp_path):
    pytest.importorskip("yaml", reason="the extra yaml is not installed")
    layouts.write_points(tmp_path / "lidar/a.bin")
    layouts.write_image(tmp_path / "front/a.png")
    matrix = "K: [50, 0, 40, 0, 50, 30, 0, 0, 1]\nD: []\n"
    layouts.write_text(tmp_path / "camera.yaml", f"image_width: 80\nimage_height: 60\n{matrix}")
    lines = (
        'points = "lidar/{frame}.bin"',
        "[cameras.front]",
        'images = "front/{frame}.png"',
        'calibration = "camera.yaml"',
        f"T_camera_lidar = {layouts.T.tolist()}",
        "image_size = [30, 40]",
    )
    layouts.write_text(tmp_path / "ldls.toml", "\n".join(lines))
    with pytest.raises(ldls.CalibrationError, match=r"cameras.front: image_size is \(30, 40\), .* says \(60, 80\)"):
        open_source(tmp_path)[0]


def without(*paths):
    def change(folder):
        for path in paths:
            target = folder / path
            shutil.rmtree(target) if target.is_dir() else target.unlink()

    return change


def with_text(path, text):
    return lambda folder: layouts.write_text(folder / path, text)


def replaced(path, old, new):
    return lambda folder: (folder / path).write_text((folder / path).read_text().replace(old, new))


@pytest.mark.parametrize(
    ("kind", "change", "error", "message"),
    [
        pytest.param("kitti-object", without("image_2"), ldls.SourceError, "has no folder image_2; found calib, vel",
                     id="object without images"),
        pytest.param("kitti-object", without(*(f"calib/00000{k}.txt" for k in range(3))), ldls.SourceError,
                     "velodyne 3, calib 0, image_2 3", id="object without any calibration"),
        pytest.param("kitti-object", with_text("calib/000000.txt", "P2: 1 2 3\n"), ldls.CalibrationError,
                     "expected 12 numbers, got 3", id="object with a broken calibration"),
        pytest.param("kitti-object", with_text("annotations/000000.txt", "0 background\n" * 99), ldls.InputError,
                     "labels: 99, points: 100", id="object with too few annotations"),
        pytest.param("kitti-raw", without("../calib_velo_to_cam.txt"), FileNotFoundError, "calib_velo_to_cam.txt",
                     id="raw without calibration"),
        pytest.param("kitti-raw", with_text("../calib_velo_to_cam.txt", "R: 1 0 0 0 1 0 0 0 1\n"),
                     ldls.CalibrationError, "key 'T' missing", id="raw without translation"),
        pytest.param("kitti-raw", with_text("image_02/timestamps.txt", "2011-09-26 13:02:25.9\n"), ldls.SourceError,
                     "has 1 stamps, expected one for each frame up to 0000000002", id="raw with too few stamps"),
        pytest.param("kitti-raw", replaced("velodyne_points/timestamps.txt", "13:02:26", "noon"),
                     ldls.CorruptFileError, "line 2: expected a time", id="raw with a broken stamp"),
        pytest.param("kitti-raw", without("image_02"), ldls.SourceError, "no folder image_02; found velodyne_points",
                     id="raw without images"),
        pytest.param("kitti-odometry", with_text("times.txt", "0.0\n"), ldls.SourceError, "has 1 stamps",
                     id="odometry with too few stamps"),
        pytest.param("kitti-odometry", with_text("times.txt", "0.0\n0_1\n0.2\n"), ldls.CorruptFileError,
                     "line 2: expected a time such as .*, got '0_1'", id="underscore in a time"),
        pytest.param("kitti-odometry", with_text("times.txt", "17e17\n" * 3), ldls.CorruptFileError,
                     "line 1: expected a time such as 0.103736, in seconds", id="odometry with nanoseconds"),
        pytest.param("kitti-odometry", with_text("times.txt", "0.0\nnan\n0.2\n"), ldls.CorruptFileError,
                     "line 2: expected a time", id="odometry with a broken time"),
        pytest.param("kitti-odometry", with_text("calib.txt", f"P2: {layouts.row(layouts.P)}\n"),
                     ldls.CalibrationError, "key 'Tr_velo_to_cam' missing", id="odometry without Tr"),
        pytest.param("kitti-odometry", with_text("labels/000000.label", "abcd"), ldls.CorruptFileError, "class 25185",
                     id="odometry with a broken label"),
        pytest.param("nuscenes", without("v1.0-mini/sample_data.json"), ldls.SourceError,
                     "has no v1.0-\\*/sample_data.json, as nuScenes has beside .*; found .*samples, v1.0-mini",
                     id="no version of nuscenes"),
        pytest.param("nuscenes", without("v1.0-mini/ego_pose.json"), ldls.SourceError, "has no ego_pose.json; found",
                     id="nuscenes without poses"),
        pytest.param("nuscenes", without("samples/CAM_BACK"), ldls.SourceError, "none of 2 key frames .* 2 no CAM_BACK",
                     id="nuscenes without a camera's files"),
        pytest.param("nuscenes", with_text("v1.0-mini/sample.json", '[{"token": "a"}'), ldls.CorruptFileError,
                     "row 1: lacks scene_token, timestamp", id="nuscenes with another sample table"),
        pytest.param("nuscenes", with_text("v1.0-mini/sensor.json", "[]x"), ldls.SourceError, "has no lidar",
                     id="nuscenes without sensors"),
        pytest.param("nuscenes", replaced("v1.0-mini/sample_data.json", "samples/CAM_BACK/", "../CAM_BACK/"),
                     ldls.UnsafePathError, "leads out of", id="nuscenes with a path that climbs out"),
        pytest.param("nuscenes", replaced("v1.0-mini/calibrated_sensor.json", "0.5", "0.7"), ldls.CalibrationError,
                     "has length 1.4, expected 1", id="nuscenes with a rotation that is none"),
        pytest.param("folder", with_text("ldls.toml", "points = 3 4"), ldls.CorruptFileError, "not a whole TOML file",
                     id="folder with broken TOML"),
        pytest.param("folder", replaced("ldls.toml", "images =", "image ="), ldls.ParameterError,
                     "unknown key 'image', .*did you mean 'images'", id="folder with a misspelt key"),
        pytest.param("folder", replaced("ldls.toml", '"lidar/{frame}.bin"', "7"), ldls.ParameterError,
                     "points is 7, expected a text", id="folder with a number for a path"),
        pytest.param("folder", replaced("ldls.toml", "T_camera_lidar", "#"), ldls.ParameterError,
                     "has no calibration", id="folder without extrinsics"),
        pytest.param("folder", replaced("ldls.toml", "[0.0, 0.0, 1.0]]", "[0.0, 0.0, 0.0]]"), ldls.CalibrationError,
                     "cameras.front", id="folder with a singular K"),
        pytest.param("folder", replaced("ldls.toml", "lidar/{frame}", "../lidar/{frame}"), ldls.UnsafePathError,
                     "leads out of", id="folder with a path that climbs out"),
        pytest.param("folder", replaced("ldls.toml", "lidar/{frame}", "/lidar/{frame}"), ldls.UnsafePathError,
                     "leads out of", id="folder with an absolute path"),
        pytest.param("folder", replaced("ldls.toml", "lidar/{frame}", "lidar/x"), ldls.ParameterError,
                     "has no {frame}", id="folder without {frame}"),
        pytest.param("folder", with_text("stamps.txt", "a 1.0\n"), ldls.SourceError,
                     "no stamp of 1 frames, the first is b$", id="folder with too few stamps"),
        pytest.param("folder", with_text("stamps.txt", "a.bin 1.0\nb.bin 1.1\n"), ldls.SourceError,
                     "no stamp of 2 frames, the first is a; it has one of 'a.bin', which is no frame",
                     id="folder with stamps of files"),
        pytest.param("folder", with_text("stamps.txt", "a 1700000000000\nb 1700000000100\n"), ldls.CorruptFileError,
                     "stamps.txt, line 1: stamp: got 17000.*, expected seconds", id="folder with milliseconds"),
        pytest.param("folder", with_text("stamps.txt", "c 0.0\na 1.0\nb 2.0\na 3.0\n"), ldls.CorruptFileError,
                     "stamps.txt, line 4: frame a has a stamp in line 2 already", id="folder with a stamp twice"),
        pytest.param("folder", with_text("stamps.txt", "# frame seconds\na 1.0\n\na 3.0\n"), ldls.CorruptFileError,
                     "stamps.txt, line 4: frame a has a stamp in line 2 already",
                     id="folder with a stamp twice below a comment"),
        pytest.param("folder", with_text("stamps.txt", "a 1.0\nb inf\n"), ldls.CorruptFileError,
                     "stamps.txt, line 2: stamp: got inf, expected seconds", id="folder with an endless stamp"),
        pytest.param("folder", without("front"), ldls.SourceError, "points 2, cameras.front 0",
                     id="folder without images"),
    ],
)  # fmt: skip
def test_what_is_missing_or_broken_is_said(tmp_path, kind, change, error, message):
    path = WRITERS[kind](tmp_path)
    change(path)
    with pytest.raises(error, match=message):
        open_source(path, kind=kind)[0]


def test_links_out_of_a_folder_are_refused_unless_they_are_allowed(tmp_path):
    folder = layouts.plain_folder(tmp_path / "inside")
    (folder / "lidar").rename(tmp_path / "lidar")
    (folder / "lidar").symlink_to(tmp_path / "lidar")
    with pytest.raises(ldls.UnsafePathError, match=r"by a link .*; copy it there, or pass allow_outside=True$"):
        open_source(folder)
    assert len(open_source(folder, allow_outside=True)) == 2


@pytest.mark.parametrize(
    ("make", "options", "error", "message"),
    [
        pytest.param(lambda p: None, {}, ldls.SourceError,
                     "is no source of frames; `ldls init` describes .*; looked for .*ldls.toml", id="empty folder"),
        pytest.param(layouts.kitti_raw, {}, ldls.SourceError, "is no source of frames; perhaps .*/2011_09_26\\?; `ldls",
                     id="the folder above one"),
        pytest.param(lambda p: (layouts.kitti_object(p), layouts.plain_folder(p)), {}, ldls.SourceError,
                     "may be kitti-object .* folder .*say which by kind=", id="two kinds in one folder"),
        pytest.param(layouts.kitti_object, {"kind": "kitti"}, ldls.ParameterError, "did you mean 'kitti-",
                     id="no such kind"),
        pytest.param(layouts.kitti_object, {"camara": 3}, ldls.ParameterError,
                     "expected camera, split, masks, truth; did you mean 'camera'?", id="no such option"),
        pytest.param(layouts.kitti_object, {"camera": 4}, ldls.ParameterError, "from 0 to 3", id="no such camera"),
        pytest.param(layouts.kitti_object, {"camera": (2, 2)}, ldls.ParameterError, "different", id="a camera twice"),
        pytest.param(lambda p: (layouts.kitti_raw(p), shutil.copytree(p / "2011_09_26/2011_09_26_drive_0001_sync",
                                                                      p / "2011_09_26/2011_09_26_drive_0002_sync")),
                     {"at": "2011_09_26"}, ldls.SourceError, "holds 2 drives .*say which by drive=", id="two drives"),
    ],
)  # fmt: skip
def test_what_cannot_be_opened_is_refused(tmp_path, make, options, error, message):
    make(tmp_path)
    options = dict(options)
    with pytest.raises(error, match=message):
        open_source(tmp_path / options.pop("at", "."), **options)


def test_a_path_that_is_not_there_is_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        open_source(tmp_path / "nothing")


def test_every_kind_says_what_it_looks_for():
    assert all(source.kind == kind and source.looks_for for kind, source in SOURCES.items())


def test_real_kitti_frames(data_folder):
    source = open_source(data_folder / "kitti")
    assert source.names == ("000000", "000001", "000002", "000003", "000571")
    frame = source[4]
    assert len(frame.points) == 123_131 and n_in_view(frame) == 20_301 and frame.truth is None
    assert source[0].truth.counts()["Pedestrian"] == 376


def test_all_six_cameras_of_a_real_nuscenes_frame_see_points(data_folder):
    (frame,) = open_source(data_folder / "nuscenes")
    shares = [n_in_view(frame, camera) / len(frame.points) for camera in range(6)]
    assert len(frame.images) == 6 and min(shares) > 0.08 and sum(shares) == pytest.approx(0.63, abs=0.02)
    boxes = read_boxes_2d(data_folder / "nuscenes")
    assert boxes.keys() == {image.name for image in frame.images}
    views = [ldls.View(_filled(boxes[image.name]), image.camera, image.name) for image in frame.images]
    result = ldls.segment(frame.points, views)
    found = {name for name, o in zip([i.name for i in result.instances], result.objects, strict=True) if o.n_points}
    assert {"truck", "pedestrian"} <= found


def test_the_middle_of_a_real_nuscenes_box_is_its_middle(data_folder):
    """The points in the boxes are those that nuScenes counted, but for a few at the faces."""
    import json

    from ldls.datasets.nuscenes_frame import points_in_upright_box

    points = open_source(data_folder / "nuscenes")[0].points
    boxes = json.loads((data_folder / "nuscenes/frame.json").read_text())["boxes_3d"]
    found = [int(points_in_upright_box(points, np.array(box["center_size_yaw"])).sum()) for box in boxes]
    counted = [box["lidar_points"] for box in boxes]
    assert np.abs(np.subtract(found, counted)).sum() <= 0.03 * sum(counted)


def _filled(boxes):
    """Masks that are the rectangles of 2D boxes."""
    pixels = np.zeros((len(boxes), 900, 1600), bool)
    for number, box in enumerate(boxes):
        left, top, right, bottom = np.clip(box.ltrb_px, 0, 1600).astype(int)
        pixels[number, top:bottom, left:right] = True
    names = {1: "pedestrian", 2: "truck", 3: "other"}
    categories = [{"pedestrian": 1, "truck": 2}.get(box.category, 3) for box in boxes]
    return ldls.InstanceMasks.from_array(pixels, categories=categories, scores=np.ones(len(boxes)), names=names)


def test_frames_come_one_after_the_other(tmp_path):
    source = open_source(layouts.many_frames(tmp_path / "source", 3))
    assert [frame.name for frame in source] == list(source.names)


def test_other_cameras_in_the_layout_of_nuscenes(tmp_path):
    layouts.nuscenes(tmp_path, n_frames=1, channels=("LIDAR_CONCAT", "CAM_SIDE", "CAM_BACK"))
    source = open_source(tmp_path)
    assert source.camera_names == ("CAM_BACK", "CAM_SIDE")
    assert [image.name for image in source[0].images] == ["CAM_BACK", "CAM_SIDE"]


OWN_CATEGORIES = [{"name": name, "index": at} for at, name in ((17, "tractor"), (2, "barn"), (3, "barn"))]


@pytest.mark.parametrize("table", ["lidarseg", "panoptic"])
def test_truth_in_the_layout_of_nuscenes_has_the_classes_of_its_own_table(tmp_path, table):
    folder = layouts.nuscenes(tmp_path, n_frames=1)
    layouts.write_text(folder / "v1.0-mini/category.json", json.dumps(OWN_CATEGORIES))
    labels = np.repeat(np.array([17, 2, 3, 0], np.uint16), [50, 20, 10, 20])
    if table == "panoptic":
        rows = json.loads((folder / "v1.0-mini/lidarseg.json").read_text())
        rows[0]["filename"] = "a_panoptic.npz"
        layouts.write_text(folder / "v1.0-mini/panoptic.json", json.dumps(rows))
        np.savez(folder / "a_panoptic.npz", data=1000 * labels)
    else:
        layouts.write_points(next(folder.glob("lidarseg/*/*.bin")), labels.astype(np.uint8))
    truth = open_source(folder)[0].truth
    assert truth.counts() == {"background": 0, "tractor": 50, "barn": 30, "noise": 20}


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        pytest.param([OWN_CATEGORIES[0]] * 2, "row 2: index is 17, as in another row", id="twice"),
        pytest.param([{"name": "barn", "index": -1}], "row 1: index is -1, expected 0 to 65535", id="negative"),
        pytest.param([{"name": "barn", "index": 1 << 16}], "row 1: index is 65536, expected 0 to", id="too large"),
        pytest.param([{"name": "barn", "index": "1"}], "row 1: index is '1', expected 0 to", id="text"),
        pytest.param([{"name": 1, "index": 1}], "row 1: name is '1', expected", id="a number as the name"),
        pytest.param([{"index": 1}], "row 1: lacks name", id="no name"),
    ],
)
def test_a_table_of_categories_that_is_none_is_refused(tmp_path, rows, message):
    folder = layouts.nuscenes(tmp_path, n_frames=1)
    layouts.write_text(folder / "v1.0-mini/category.json", json.dumps(rows))
    with pytest.raises(ldls.CorruptFileError, match=rf"category\.json, {message}"):
        open_source(folder)
    assert open_source(folder, truth=False)[0].truth is None


def test_a_data_set_of_others_in_the_layout_of_nuscenes(data_folder):
    source = open_source(data_folder / "real/t4")
    assert (len(source), source.camera_names) == (3, ("CAM_FRONT", "CAM_BACK"))
    frame = source[0]
    assert len(frame.points) > 0 and frame.images[0].camera.distortion.model == "plumb_bob"
    np.testing.assert_allclose(np.linalg.inv(frame.images[0].camera.T_camera_lidar)[:3, 3], [1.5, 0, -0.2], atol=1e-9)
