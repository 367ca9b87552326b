"""`ldls info` from the outside."""

import numpy as np
import pytest
from PIL import Image

import ldls
from command import command
from datasets import layouts, ros_samples
from ldls.datasets.inspection import check_stamps, field_of_view_deg, sample
from ldls.io.ros.messages import TRANSFORMS, Topic
from ldls.io.ros.writer import BagWriter


def test_a_sound_drive_is_described(tmp_path):
    drive = layouts.kitti_raw(tmp_path, n_frames=6)
    (drive / "velodyne_points/data/0000000002.bin").unlink()
    result = command("info", drive, "--all", "--picture", tmp_path / "check.png", "--frame", "0000000001")
    assert result.exit_code == 0, result.output
    for expected in (
        "kitti-raw",
        "1 no velodyne_points",
        "1.0 frames a second",
        "60 x 80",
        "77 x 62",
        "50.0%",
        "-0.010",
    ):
        assert expected in result.output
    with Image.open(tmp_path / "check.png") as picture:
        assert (picture.width, picture.height) == (1242, 932)
        assert len(np.unique(np.asarray(picture).reshape(-1, 3), axis=0)) > 20, "points are drawn in colours of depth"


def test_images_of_several_sizes_are_told(tmp_path):
    drive = layouts.kitti_object(tmp_path)
    layouts.write_image(drive / "image_2/000001.png", (58, 81))
    result = command("info", drive)
    assert result.exit_code == 0 and "58 to 60 x 80 to 81" in result.output, result.output


def _without_points(drive):
    (drive / "velodyne_points/data/0000000001.bin").unlink()
    np.save(drive / "velodyne_points/data/0000000001.npy", np.zeros((0, 4), np.float32))


@pytest.mark.parametrize(
    ("change", "status", "message"),
    [
        pytest.param(lambda d: (d / "velodyne_points/data/0000000001.bin").write_bytes(b"123"), 1,
                     "3 bytes is not a multiple of 16", id="a cut sweep"),
        pytest.param(lambda d: (d / "velodyne_points/data/0000000001.bin").write_bytes(b""), 1,
                     "empty, expected 4 float32 a point", id="an empty sweep"),
        pytest.param(_without_points, 1, "its cloud is empty", id="a sweep without a point"),
        pytest.param(lambda d: layouts.write_points(d / "velodyne_points/data/0000000001.bin",
                                                    layouts.cloud() * np.float32(np.nan)), 1,
                     "none of its 100 points is finite", id="a cloud of NaN"),
        pytest.param(lambda d: layouts.write_points(d / "velodyne_points/data/0000000001.bin",
                                                    layouts.cloud() * np.float32(1000)), 0,
                     "m, over 10 km; are they in metres?", id="a cloud in millimetres"),
        pytest.param(lambda d: (d / "image_02/data/0000000001.png").write_bytes(b"PNG"), 1, "not a whole image",
                     id="a broken image"),
        pytest.param(lambda d: layouts.write_image(d / "image_02/data/0000000001.png", (30, 40)), 1,
                     "image is 30 x 40, its calibration is for 60 x 80", id="an image of another size"),
        pytest.param(lambda d: layouts.write_text(d.parent / "calib_velo_to_cam.txt",
                                                  "R: 0 0 -1 0 1 0 1 0 0\nT: 0 0 -50\n"), 1, "wrong calibration?",
                     id="a camera that sees nothing"),
        pytest.param(lambda d: layouts.write_text(d.parent / "calib_velo_to_cam.txt",
                                                  "R: 0 0 1 -1 0 0 0 -1 0\nT: 0 0 0\n"), 1,
                     "z of the lidar does not point up in the image; is it the inverse?", id="an inverse"),
        pytest.param(lambda d: _stamps(d, "velodyne_points", ["25.0", "26.0", "25.5"]), 1, "0.500 s before that of",
                     id="a step back"),
        pytest.param(lambda d: _stamps(d, "velodyne_points", ["25.0", "25.1", "25.1"]), 1, "its stamp is that of",
                     id="a stamp twice"),
        pytest.param(lambda d: _stamps(d, "image_02", ["25.0", "25.1", "25.2"]), 0, "taken -1.851 s from the sweep",
                     id="images of another time"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found(tmp_path, change, status, message):
    drive = layouts.kitti_raw(tmp_path)
    change(drive)
    result = command("info", drive)
    assert message in " ".join(result.output.replace("│", " ").split()), result.output
    assert result.exit_code == status


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param(["--dataset", "kitti"], "expected one of kitti-object", id="no such kind"),
        pytest.param(["--option", "camera"], "expected NAME=VALUE", id="an option without a value"),
        pytest.param(["--option", "camera=7"], "from 0 to 3", id="no such camera"),
        pytest.param(["--option", "camera=2.5"], "camera: got 2.5, expected a whole number or", id="half a camera"),
        pytest.param(["--option", "drive=5"], "drive: got 5, expected text", id="a number for a name"),
        pytest.param(["--option", "truth=maybe"], "truth: got 'maybe', expected True or False", id="text for a flag"),
        pytest.param(["--option", "kind=folder"], "--option: got 'kind=folder', expected", id="the kind"),
        pytest.param(["--option", "path=x"], "--option: got 'path=x', expected", id="the path"),
        pytest.param(["--frame", "9", "--picture", "x.png"], "expected a name from", id="no such frame"),
        pytest.param(["--picture", "x.jpg"], "cannot write '.jpg' pictures", id="another format"),
        pytest.param(["--frame", "0"], "--frame: the frame to draw, and there is no --picture", id="nothing to draw"),
    ],
)
def test_wrong_options_are_refused(tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    result = command("info", layouts.kitti_raw(tmp_path), *options)
    assert result.exit_code == 1 and message in result.stderr
    assert result.stdout == "", "nothing is looked at"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("camera=3", 3),
        ("camera=2,3", (2, 3)),
        ("sequence=08", "08"),
        ("truth=false", False),
        ("scene=a-1", "a-1"),
        ("max_offset_s=0.2", 0.2),
        ("image_topics=/a,/b", ("/a", "/b")),
        ('image_topics=["/a", "/b"]', ["/a", "/b"]),
        ("image_topics=[]", []),
        ('fields={"x": "px"}', {"x": "px"}),
        ('scene="5"', "5"),
        ('masks="a,b"', "a,b"),
        ("scene=", ""),
        ("scene=a=b", "a=b"),
    ],
)
def test_options_become_values(text, value):
    from ldls.cli.source_options import parse_options

    (found,) = parse_options([text]).values()
    assert found == value and type(found) is type(value)


def test_the_sample_has_the_first_and_the_last():
    assert sample(100, 5)[0] == 0 and sample(100, 5)[-1] == 99 and len(sample(100, 5)) == 5
    assert sample(3, 8) == [0, 1, 2] and sample(1, 8) == [0]


def test_gaps_and_steps_back_are_told_apart():
    names = tuple("abcdef")
    found = check_stamps(names, (0.0, 0.1, 0.2, 0.9, None, 0.8))
    assert [(finding.frame, finding.broken) for finding in found] == [("d", False), ("f", True)]
    assert check_stamps(names[:2], (None, None)) == []


def test_field_of_view_is_that_of_the_projection_and_its_distortion():
    pinhole = ldls.Camera(projection=layouts.K, image_size=layouts.SIZE)
    assert field_of_view_deg(pinhole) == pytest.approx((77.3, 61.9), abs=0.7)
    barrel = ldls.Distortion("plumb_bob", (-0.1, 0, 0, 0, 0))
    wider = ldls.Camera(projection=layouts.K, image_size=layouts.SIZE, distortion=barrel)
    assert field_of_view_deg(wider)[0] > field_of_view_deg(pinhole)[0] + 2


def test_real_frames_look_sound(data_folder):
    for folder in ("kitti", "nuscenes"):
        result = command("info", data_folder / folder)
        assert result.exit_code == 0 and "found nothing wrong" in result.output


def _stamps(drive, sensor, seconds):
    lines = [f"2011-09-26 13:02:{text}\n" for text in seconds]
    layouts.write_text(drive / sensor / "timestamps.txt", "".join(lines))


def test_a_bag_of_clouds_alone_is_looked_at_and_told_what_it_lacks(tmp_path):
    pytest.importorskip("rosbags")
    bag = ros_samples.Recording(image_topics=(), info_topics=()).write(tmp_path / "clouds.bag")
    done = command("info", bag)
    assert done.exit_code == 0, done.output
    for topic, kind, count in (("/points", "PointCloud2", 3), ("/tf_static", "TFMessage", 1), ("/tf", "TFMessage", 0)):
        (line,) = [line for line in done.output.splitlines() if f" {topic} " in line]
        assert kind in line and line.split()[-2] == str(count)
    assert "2.0% of its points are not finite" in done.output
    assert "no images, so that `ldls run` has no camera to label the points by; record a topic of images" in done.output


def test_the_topics_of_a_bag_are_listed(tmp_path):
    pytest.importorskip("rosbags")
    bag = ros_samples.Recording().write(tmp_path / "small.bag")
    done = command("info", bag)
    assert "/camera/camera_info" in done.output and "sensor_msgs/msg/Image" in done.output
    assert "no images, so that" not in done.output


def test_a_bag_of_two_cameras_opens_with_their_topics(tmp_path):
    pytest.importorskip("rosbags")
    topics = ("/left/image_raw", "/right/image_raw")
    infos = ("/left/camera_info", "/right/camera_info")
    bag = ros_samples.Recording(image_topics=topics, info_topics=infos).write(tmp_path / "two.bag")
    refused = command("info", bag)
    assert refused.exit_code == 1 and "--option image_topics=/left/image_raw" in " ".join(refused.output.split())
    one = command("info", bag, "--option", "image_topics=/left/image_raw").output
    assert "left_image_raw: sees" in one and "right_image_raw: sees" not in one
    both = command("info", bag, "--option", f"image_topics={','.join(topics)}", "--option", "max_offset_s=0.2").output
    assert "left_image_raw: sees" in both and "right_image_raw: sees" in both


def test_whether_there_are_poses_is_said_and_what_they_come_with(tmp_path):
    said = command("info", layouts.kitti_raw(tmp_path / "raw", n_frames=2)).output
    assert "none; they come with oxts/ and the day's" in said
    pytest.importorskip("rosbags")
    bag = ros_samples.Recording(moving=(("odom", "base"),)).write(tmp_path / "small.bag")
    assert "none; they come with --option world=odom " in command("info", bag).output
    assert "in 3 of 3 frames" in command("info", bag, "--option", "world=odom").output


def test_poses_that_an_option_leaves_out_are_not_said_to_be_missing(tmp_path):
    pytest.importorskip("rosbags")
    drives = [layouts.kitti_raw(tmp_path / "raw", n_frames=2), layouts.nuscenes(tmp_path / "nuscenes")]
    drives += [layouts.kitti_odometry(tmp_path / "odometry"), ros_samples.Recording().write(tmp_path / "small.bag")]
    for drive in drives:
        said = command("info", drive, "--option", "poses=false").output
        assert "none; they are left out by --option poses=false" in said


def test_a_bag_without_clouds_is_refused_with_its_topics(tmp_path):
    pytest.importorskip("rosbags")
    with BagWriter(tmp_path / "other.bag", "rosbag1") as bag:
        bag.add_topic(Topic("/tf", TRANSFORMS, 0))
        bag.write_message("/tf", ros_samples.transforms(bag.types, (("base", "lidar"),), 5), 5)
    done = command("info", tmp_path / "other.bag")
    assert done.exit_code == 1
    assert "no topics of PointCloud2, so none is guessed; the bag has /tf (tf2_msgs/msg/TFMessage, 1)" in done.output
