"""Small bags through the source: what comes out, and what is refused and how."""

import pickle
import shutil
from dataclasses import dataclass

import numpy as np
import pytest

pytest.importorskip("rosbags")

from datasets.ros_samples import START_NS, STEP_NS, Recording, picture, storage, transforms
from ldls.datasets import RosBag, open_source
from ldls.errors import (
    CalibrationError,
    CorruptFileError,
    FileFormatError,
    InputError,
    ParameterError,
    PoseError,
    RecoveredFileWarning,
    TruncatedFileError,
    UnsupportedFormatError,
)
from ldls.io.ros.bags import open_bag
from ldls.io.ros.messages import POINTS, TRANSFORMS, Header, Topic
from ldls.io.ros.point_cloud2 import encode
from ldls.io.ros.writer import BagWriter
from ldls.stages import project

KINDS = ("rosbag1", "rosbag2", "mcap")
LIDAR_TO_OPTICAL = np.array([[0, -1, 0, 0], [0, 0, -1, -1], [1, 0, 0, 0], [0, 0, 0, 1.0]])
"""Between the frames of a `Recording`: the lidar is 1 m above the camera."""


def written(tmp_path, **changes):
    recording = Recording(**changes)
    return recording.write(tmp_path / ("small.bag" if recording.kind == "rosbag1" else "small"))


@pytest.mark.parametrize("kind", KINDS)
def test_frames_hold_clouds_images_and_cameras(tmp_path, kind):
    bag = RosBag(written(tmp_path, kind=kind))
    assert (len(bag), bag.kind, bag.unpaired) == (3, "rosbag", 0)
    assert bag.names == tuple(str(START_NS + k * STEP_NS) for k in range(3))
    np.testing.assert_allclose(bag.offsets_s, 0.01)
    for number, frame in enumerate(bag):
        expected = np.column_stack(list(Recording().cloud(number).values()))
        np.testing.assert_array_equal(frame.points, expected)
        assert frame.points.dtype == np.float32
        (image,) = frame.images
        assert (frame.stamp, image.stamp) == pytest.approx((1000 + 0.1 * number, 1000.01 + 0.1 * number))
        np.testing.assert_array_equal(image.read(), picture(number))
        np.testing.assert_allclose(image.camera.T_camera_lidar, LIDAR_TO_OPTICAL, atol=1e-9)
        assert image.camera.distortion.model == "plumb_bob"
        assert image.camera.image_size == (60, 80)
    assert bag.header(1).stamp_ns == START_NS + STEP_NS
    assert bag.header(1).frame_id == "lidar"
    with pytest.raises(IndexError, match="there are 3"):
        bag[3]


@pytest.mark.parametrize(("kind", "suffix"), [("rosbag2", ".db3"), ("mcap", ".mcap")])
def test_bare_storage_files_are_bags(tmp_path, kind, suffix):
    bag = RosBag(written(tmp_path, kind=kind) / f"small{suffix}")
    np.testing.assert_array_equal(bag[2].images[0].read(), picture(2))


def test_a_bag_is_recognised_and_names_its_camera_and_files(tmp_path):
    source = open_source(written(tmp_path), truth=False)
    assert source.kind == "rosbag"
    assert source.camera_names == tuple(image.name for image in source[0].images)
    assert all(path.is_file() for path in source.files(0))


def test_a_source_travels_between_processes(tmp_path):
    bag = pickle.loads(pickle.dumps(RosBag(written(tmp_path))))
    frame = pickle.loads(pickle.dumps(bag[1]))
    np.testing.assert_array_equal(frame.images[0].read(), picture(1))


def test_doubles_stay_doubles(tmp_path):
    assert RosBag(written(tmp_path, point_dtype=np.float64))[0].points.dtype == np.float64


def test_clouds_need_no_images(tmp_path):
    bag = RosBag(written(tmp_path, image_topics=(), info_topics=()), image_topics=())
    assert len(bag) == 3 and bag[0].images == () and bag.offsets_s.shape == (3, 0)


def test_sweeps_without_an_image_are_no_frames(tmp_path):
    path = written(tmp_path, image_offset_ns=STEP_NS + 10_000_000)
    bag = RosBag(path)
    assert (len(bag), bag.unpaired) == (2, 1)
    assert bag.names[0] == str(START_NS + STEP_NS)
    np.testing.assert_array_equal(bag[0].images[0].read(), picture(0))
    assert len(RosBag(path, max_offset_s=0.2)) == 3


def test_several_cameras_have_their_own_topics(tmp_path):
    topics = ("/left/image_raw", "/right/image_rect_color")
    path = written(tmp_path, image_topics=topics, info_topics=("/left/camera_info", "/right/camera_info"))
    left, right = RosBag(path, image_topics=topics)[0].images
    assert (left.name, right.name) == ("left_image_raw", "right_image_rect_color")
    assert left.camera.projection[0, 0] == 100 and not left.camera.distortion.is_none
    assert right.camera.projection[0, 0] == 110 and right.camera.distortion.is_none


def test_moving_frames_are_looked_up_at_the_nearest_time(tmp_path):
    path = written(tmp_path, edges=(("base", "lidar"), ("head", "camera")), moving=(("base", "head"),))
    heights = [frame.images[0].camera.T_camera_lidar[1, 3] for frame in RosBag(path)]
    np.testing.assert_allclose(heights, [-1, 0, 1], atol=1e-9)


def robots(tmp_path, points_topic, heights):
    """A bag of one cloud; under each prefix the lidar is so high above the base."""
    path = tmp_path / "robots.bag"
    with BagWriter(path, "rosbag1") as bag:
        bag.add_topic(Topic(points_topic, POINTS, 0))
        for prefix, height in heights.items():
            bag.add_topic(Topic(f"{prefix}/tf_static", TRANSFORMS, 0, latched=True))
            message = transforms(bag.types, [("base", "lidar")], START_NS, height=height - 1.0)
            bag.write_message(f"{prefix}/tf_static", message, START_NS)
        bag.write_message(points_topic, encode(bag.types, Recording().cloud(0), Header(START_NS, "lidar")), START_NS)
    return path


@pytest.mark.parametrize(
    ("points_topic", "heights", "expected"),
    [
        pytest.param("/r1/lidar/points", {"/r2": 2, "": 3, "/r1": 4}, 4, id="its own"),
        pytest.param("/r1/points", {"/r1": 2, "/r2": 3, "/r11": 4}, 2, id="the first"),
        pytest.param("/r11/points", {"/r1": 2, "/r11": 3}, 3, id="a longer name"),
        pytest.param("/points", {"/r1": 2, "": 3, "/r2": 4}, 3, id="without a prefix"),
        pytest.param("/points", {"/r1": 2}, 2, id="another's, where there is no other"),
        pytest.param("/points", {"/r1": 2, "/r2": 2}, 2, id="the same from two"),
    ],
)
def test_of_several_robots_the_transforms_are_those_of_the_clouds_prefix(tmp_path, points_topic, heights, expected):
    bag = RosBag(robots(tmp_path, points_topic, heights), image_topics=(), world="base")
    assert bag[0].pose[2, 3] == expected


@pytest.mark.parametrize(("own", "other"), [("/r1", ""), ("", "/camera")])
def test_transforms_that_other_topics_alone_have_count_too(tmp_path, own, other):
    path = tmp_path / "robot.bag"
    with BagWriter(path, "rosbag1") as bag:
        bag.add_topic(Topic(f"{own}/points", POINTS, 0))
        for topic, edges in {
            f"{other}/tf_static": [("base", "lidar"), ("mast", "base")],
            f"{own}/tf_static": [("base", "lidar")],
        }.items():
            bag.add_topic(Topic(topic, TRANSFORMS, 0, latched=True))
            height = float(len(edges))
            bag.write_message(topic, transforms(bag.types, edges, START_NS, height=height), START_NS)
        bag.write_message(f"{own}/points", encode(bag.types, Recording().cloud(0), Header(START_NS, "lidar")), START_NS)
    base, mast = (RosBag(path, image_topics=(), world=world)[0].pose[2, 3] for world in ("base", "mast"))
    assert (base, mast) == (2, 4)


def test_robots_that_contradict_each_other_are_named(tmp_path):
    path = robots(tmp_path, "/points", {"/r1": 2, "/r2": 3})
    assert RosBag(path, image_topics=()).worlds() == []
    with pytest.raises(CalibrationError, match="/r1/tf_static and /r2/tf_static differ in that from base to lidar"):
        RosBag(path, image_topics=(), world="base")


@pytest.mark.parametrize("as_file", [False, True], ids=["array", "text file"])
def test_a_given_transform_comes_first(tmp_path, as_file):
    given = np.eye(4)
    given[0, 3] = 0.25
    if as_file:
        np.savetxt(tmp_path / "T.txt", given[:3], header="camera from lidar")
    bag = RosBag(written(tmp_path, edges=()), T_camera_lidar=tmp_path / "T.txt" if as_file else given)
    np.testing.assert_array_equal(bag[0].images[0].camera.T_camera_lidar, given)
    assert (tmp_path / "T.txt" in bag.files(0)) == as_file


def test_binning_and_region_move_and_scale_pixels(tmp_path):
    whole = RosBag(written(tmp_path, D=[]))[0].images[0].camera
    part = Recording(D=[], binning=2, region=(10, 20, 40, 50)).write(tmp_path / "part.bag")
    camera = RosBag(part)[0].images[0].camera
    assert camera.image_size == (20, 25)
    points = np.array([[10.0, 0.3, 0.9], [10.0, -0.1, -0.5]])
    (_, whole_uv), (_, uv) = (project(points, c, image_size=(60, 80)) for c in (whole, camera))
    np.testing.assert_allclose(uv, (whole_uv + 0.5 - (20, 10)) / 2 - 0.5)


def test_a_field_of_another_name_can_be_named(tmp_path):
    path = written(tmp_path, columns=("px", "y", "z"))
    assert RosBag(path, fields={"x": "px"})[0].points.shape == (50, 3)


def test_names_count_where_stamps_repeat(tmp_path):
    path = written(tmp_path, stamps_stand_still=True, sweeps=1)
    assert RosBag(path).names == (str(START_NS),)


ROWS = [
    pytest.param({}, {"points_topic": "/nope"}, InputError, "no such topic.*/points .sensor_msgs/msg/PointCloud2, 3",
                 id="no such topic"),
    pytest.param({}, {"points_topic": "/camera/image_raw"}, InputError, "sensor_msgs/msg/Image, expected PointCloud2",
                 id="topic of another type"),
    pytest.param({"image_topics": ("/a/image", "/b/image")}, {}, InputError, "2 topics of Image or CompressedImage",
                 id="two image topics to guess from"),
    pytest.param({"info_topics": ()}, {}, InputError, "info_topics: no topics of CameraInfo", id="no CameraInfo"),
    pytest.param({"sweeps": 0}, {}, InputError, "has no messages", id="no messages"),
    pytest.param({"image_offset_ns": 5_000_000_000}, {}, InputError, r"within 0.05 s.*nearest is \+4\.800000 s off",
                 id="stamps that never match"),
    pytest.param({"stamps_stand_still": True}, {}, InputError, "all 3 messages of /points have the stamp",
                 id="a clock that stands still"),
    pytest.param({}, {"max_offset_s": -1}, ParameterError, "max_offset_s: got -1", id="negative tolerance"),
    pytest.param({}, {"T_camera_lidar": {"/nope": np.eye(4)}}, ParameterError, "/nope is none of /camera/image_raw",
                 id="transform of no camera"),
    pytest.param({}, {"fields": {"X": "x"}}, ParameterError, "fields: got X, expected x, y, z", id="no such field"),
    pytest.param({}, {"image_topics": 3}, ParameterError, "image_topics: got 3, expected text or a list of text",
                 id="a number for topics"),
    pytest.param({}, {"max_offset_s": "x"}, ParameterError, "max_offset_s: got 'x', expected a finite number",
                 id="text for a number"),
    pytest.param({}, {"fields": "x"}, InputError, "fields: expected a dict of text by text, got str",
                 id="text for names of fields"),
    pytest.param({}, {"world": True}, ParameterError, "world: got True, expected text", id="a flag for a frame"),
    pytest.param({}, {"recover": "maybe"}, ParameterError, "recover: got 'maybe', expected True or False",
                 id="text for a flag"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "options", "error", "message"), ROWS)
def test_what_cannot_be_opened_is_refused(tmp_path, changes, options, error, message):
    path = written(tmp_path, **changes)
    with pytest.raises(error, match=message):
        RosBag(path, **options)


FRAME_ROWS = [
    pytest.param({"edges": ()}, CalibrationError, "nothing connects .*'lidar' .*'camera'; found none", id="no tf"),
    pytest.param({"edges": (("base", "lidar"), ("map", "pole"))}, CalibrationError,
                 "found base <- lidar; map <- pole", id="missing transform"),
    pytest.param({"model": "cata_fish"}, CalibrationError, "'cata_fish' is unknown", id="unknown distortion"),
    pytest.param({"K": [0.0] * 9}, CalibrationError, "K: all zeros, expected focal lengths", id="zero K"),
    pytest.param({"columns": ("x", "y", "height")}, FileFormatError, "field 'z'.*x float32, y float32, height float32",
                 id="missing field"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "error", "message"), FRAME_ROWS)
def test_frames_that_cannot_be_read_say_why(tmp_path, changes, error, message):
    bag = RosBag(written(tmp_path, **changes))
    with pytest.raises(error, match=message) as caught:
        bag[0]
    assert str(bag.path) in str(caught.value)


def test_an_image_of_another_size_than_its_calibration_is_refused(tmp_path):
    image = RosBag(written(tmp_path, size=(480, 640)))[0].images[0]
    with pytest.raises(CalibrationError, match=r"image is \(60, 80\), its CameraInfo says \(480, 640\)"):
        image.read()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 0.999])
def test_truncated_bags_say_how_far_they_are_whole(tmp_path, kind, share):
    path = written(tmp_path, kind=kind, sweeps=60)
    file = storage(path)
    content = file.read_bytes()
    file.write_bytes(content[: int(len(content) * share)])
    with pytest.raises(TruncatedFileError, match=r"whole messages before it, the last at 100\d\.\d{9}; pass recover"):
        RosBag(path)
    with pytest.warns(RecoveredFileWarning, match="whole messages"):
        bag = RosBag(path, recover=True)
    assert 60 * (share - 0.35) < len(bag) <= 60
    last = len(bag) - 1
    np.testing.assert_array_equal(bag[last].images[0].read(), picture(last))
    np.testing.assert_array_equal(bag[last].points, np.column_stack(list(Recording().cloud(last).values())))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [0, 5, 13, 40, 120])
def test_bags_cut_off_at_the_head_are_refused(tmp_path, kind, size):
    path = written(tmp_path, kind=kind)
    file = storage(path)
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises((TruncatedFileError, CorruptFileError), match="small"):
        RosBag(path)


def test_a_bag_that_was_never_closed_has_no_index(tmp_path):
    path = written(tmp_path)
    content = bytearray(path.read_bytes())
    at = content.index(b"index_pos=") + len(b"index_pos=")
    content[at : at + 8] = bytes(8)
    path.write_bytes(content)
    with pytest.raises(TruncatedFileError, match="has no index, as its recording was not closed; 10 whole messages"):
        RosBag(path)
    with pytest.warns(RecoveredFileWarning):
        assert len(RosBag(path, recover=True)) == 3


def test_a_folder_without_metadata_can_be_recovered(tmp_path):
    path = written(tmp_path, kind="mcap")
    (path / "metadata.yaml").unlink()
    with pytest.raises(TruncatedFileError, match="no metadata.yaml"):
        RosBag(path)
    with pytest.warns(RecoveredFileWarning):
        assert len(RosBag(path, recover=True)) == 3


def test_what_is_no_bag_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such bag"):
        RosBag(tmp_path / "none.bag")
    (tmp_path / "text.txt").write_text("text")
    with pytest.raises(UnsupportedFormatError, match=".bag, .db3, .mcap"):
        RosBag(tmp_path / "text.txt")
    with pytest.raises(CorruptFileError, match="no metadata.yaml"):
        RosBag(tmp_path)
    shutil.copy(tmp_path / "text.txt", tmp_path / "text.bag")
    with pytest.raises((CorruptFileError, TruncatedFileError), match="no ROS 1 bag"):
        RosBag(tmp_path / "text.bag")


def repacked(path, target, kind, compression):
    """The same messages in a bag whose chunks are compressed."""
    from rosbags import rosbag1, rosbag2

    source = open_bag(path)
    if kind == "rosbag1":
        writer = rosbag1.Writer(target)
        writer.chunk_threshold = 1 << 17  # an eighth of the usual: bz2 is slow
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression])
    else:
        writer = rosbag2.Writer(target, version=8, storage_plugin=rosbag2.StoragePlugin.MCAP)
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic.name: writer.add_connection(topic.name, topic.type, typestore=source.types)
            for topic in source.topics.values()
        }
        for message in source.messages(source.topics):
            writer.write(connections[message.topic], message.received_ns, message.raw)
    return target


PACKED = pytest.mark.parametrize(
    ("kind", "compression"), [("rosbag1", "BZ2"), ("rosbag1", "LZ4"), ("mcap", "ZSTD")], ids=["bz2", "lz4", "zstd"]
)


@PACKED
def test_compressed_chunks_are_read_and_recovered(tmp_path, kind, compression):
    source = written(tmp_path, kind=kind, sweeps=150)
    path = repacked(source, tmp_path / ("packed.bag" if kind == "rosbag1" else "packed"), kind, compression)
    assert len(RosBag(path)) == 150
    content = storage(path).read_bytes()
    storage(path).write_bytes(content[: int(0.8 * len(content))])
    with pytest.raises(TruncatedFileError, match="pass recover"):
        RosBag(path)
    with pytest.warns(RecoveredFileWarning):
        bag = RosBag(path, recover=True)
    assert 50 < len(bag) < 150
    last = len(bag) - 1
    np.testing.assert_array_equal(bag[last].images[0].read(), picture(last))


@PACKED
def test_damage_in_the_middle_is_found_when_it_is_read(tmp_path, kind, compression):
    source = written(tmp_path, kind=kind, sweeps=150)
    path = repacked(source, tmp_path / ("packed.bag" if kind == "rosbag1" else "packed"), kind, compression)
    content = bytearray(storage(path).read_bytes())
    content[len(content) // 3 : len(content) // 3 + 5000] = bytes(5000)
    storage(path).write_bytes(content)
    with pytest.raises(FileFormatError, match="packed"):
        list(RosBag(path))


@dataclass(kw_only=True)
class Timed(Recording):
    """A robot that rises by 10 m/s while its lidar turns, whose points have times, those of missing returns none."""

    columns: tuple = ("x", "y", "z", "intensity", "time")
    moving: tuple = (("odom", "base"),)
    edges: tuple = (("base", "lidar"), ("base", "camera"))
    sweeps: int = 5

    def cloud(self, number):
        values = super().cloud(number)
        values["time"] = np.linspace(0, 0.1, 50, dtype=np.float32)
        values["time"][7] = np.nan
        return values


@pytest.mark.parametrize("number", [0, 2, 4])
def test_a_robot_that_moves_is_moved_back(tmp_path, number):
    path = Timed().write(tmp_path / "small.bag")
    assert RosBag(path)[number].trajectory is None
    source = pickle.loads(pickle.dumps(RosBag(path, world="odom")))
    frame = source[number]
    assert frame.times.dtype == np.float64 and len(frame.times) == len(frame.points)
    deskewed = frame.deskewed()
    expected = frame.points.astype(float)
    expected[:, 2] += 10 * np.nan_to_num(frame.times)
    np.testing.assert_allclose(deskewed.points, expected, atol=1e-5)
    # the image is 10 ms later, and so the camera 0.1 m higher; its y axis points down
    camera = LIDAR_TO_OPTICAL.copy()
    camera[1, 3] += 0.1
    np.testing.assert_allclose(deskewed.images[0].camera.T_camera_lidar, camera, atol=1e-6)
    np.testing.assert_allclose(frame.images[0].camera.T_camera_lidar, LIDAR_TO_OPTICAL, atol=1e-9)


def test_times_that_make_no_sense_are_an_error_where_they_are_needed_and_can_be_left_out(tmp_path):
    path = Recording(columns=("x", "y", "z", "time"), moving=(("odom", "base"),)).write(tmp_path / "small.bag")
    frame = RosBag(path, world="odom")[1]
    with pytest.raises(PoseError, match=r"times: a point has [1-9].* s, expected at most 1 s from the stamp"):
        frame.deskewed()
    without = RosBag(path, world="odom", fields={"time": ""})[1]
    assert without.times is None
    assert np.array_equal(without.deskewed().points, frame.points, equal_nan=True)
    with pytest.raises(ParameterError, match="fields: got ring, expected x, y, z, intensity, time"):
        RosBag(path, fields={"ring": "r"})
