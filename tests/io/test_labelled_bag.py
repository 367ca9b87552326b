"""Labelled clouds as bags."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")

import ldls
from datasets.ros_samples import Recording
from ldls.datasets import RosBag
from ldls.errors import InputError, LimitError, ParameterError, RecoveredFileWarning, UnsupportedFormatError
from ldls.io.labelled_bag import LabelledBag
from ldls.io.ros.bags import open_bag
from ldls.io.ros.messages import Header
from ldls.palette import BACKGROUND, instance_colours

KINDS = ("rosbag1", "rosbag2", "mcap")
HEADER = Header(1_700_000_000_123_456_789, "velodyne")


def order(message):
    return message.received_ns, message.topic


@pytest.mark.parametrize("kind", KINDS)
def test_labels_come_back(tmp_path, result, kind):
    path = tmp_path / ("out.bag" if kind == "rosbag1" else "out")
    with LabelledBag(path, kind) as bag:
        bag.write(result, HEADER)
        assert not path.exists()
    source = RosBag(path, image_topics=())
    cloud = source.cloud(0)
    assert (cloud.header, source.names) == (HEADER, ("1700000000123456789",))
    np.testing.assert_array_equal(source[0].points[:, :3], result.points[:, :3])
    np.testing.assert_array_equal(cloud.fields["instance_id"], np.maximum(result.labels, 0))
    np.testing.assert_array_equal(cloud.fields["class_id"], result.categories)
    np.testing.assert_array_equal(cloud.fields["probability"], result.confidence)
    kinds = [cloud.fields.dtype[name] for name in ("instance_id", "class_id", "probability", "intensity")]
    assert kinds == [np.uint32, np.uint8, np.float32, np.float32]
    assert set(cloud.fields["class_id"]) == {0, 1, 3}
    colours = cloud.fields["rgb"].view(np.uint32)
    for label, (red, green, blue) in enumerate([BACKGROUND, *instance_colours([1, 3]).tolist()]):
        assert set(colours[np.maximum(result.labels, 0) == label]) == {red << 16 | green << 8 | blue}


@pytest.mark.parametrize("kind", KINDS)
def test_a_failure_leaves_nothing(tmp_path, result, kind):
    with pytest.raises(RuntimeError, match="power"), LabelledBag(tmp_path / "out", kind) as bag:
        bag.write(result, HEADER)
        raise RuntimeError("power")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", KINDS)
def test_other_topics_play_beside_the_labels(tmp_path, result, kind):
    source = Recording(kind=kind).write(tmp_path / ("in.bag" if kind == "rosbag1" else "in"))
    path = tmp_path / ("out.bag" if kind == "rosbag1" else "out")
    with LabelledBag(path, kind) as bag:
        bag.copy(source)
        bag.write(result, HEADER)
    before, after = open_bag(source), open_bag(path)
    assert after.topics.keys() - before.topics.keys() == {"/points_labelled"}
    assert {name: after.topics[name] for name in before.topics} == before.topics
    assert after.topics["/tf_static"].latched
    assert sorted(before.messages(before.topics), key=order) == sorted(after.messages(before.topics), key=order)
    for one, other in zip(RosBag(source), RosBag(path, points_topic="/points"), strict=True):
        np.testing.assert_array_equal(one.images[0].read(), other.images[0].read())


def test_some_topics_and_what_is_whole_of_a_broken_bag(tmp_path, result):
    source = Recording().write(tmp_path / "in.bag")
    source.write_bytes(source.read_bytes()[:-50])
    with pytest.warns(RecoveredFileWarning), LabelledBag(tmp_path / "out.bag", "rosbag1") as bag:
        bag.copy(source, topics=["/tf_static"], recover=True)
        bag.write(result, HEADER)
    assert set(open_bag(tmp_path / "out.bag").topics) == {"/tf_static", "/points_labelled"}


def test_what_does_not_go_is_refused(tmp_path):
    source = Recording(points_topic="/points_labelled").write(tmp_path / "in.bag")
    with pytest.raises(ParameterError, match="rosbag1, rosbag2, mcap"):
        LabelledBag(tmp_path / "out", "rosbag3")
    with pytest.raises(FileExistsError, match="exists already"):
        LabelledBag(source, "rosbag1")
    with pytest.raises(InputError, match="in the bag already"), LabelledBag(tmp_path / "a", "rosbag1") as bag:
        bag.copy(source)
    with (
        pytest.raises(UnsupportedFormatError, match="of ROS 1 .* of ROS 2"),
        LabelledBag(tmp_path / "a", "mcap") as bag,
    ):
        bag.copy(source)
    assert {Path(p).name for p in tmp_path.iterdir()} == {"in.bag"}


def test_categories_fit_a_byte(tmp_path, small_scene):
    points, masks, camera = small_scene
    wide = ldls.InstanceMasks.from_array(masks.to_array(), categories=[1, 300], scores=[1, 1], names={1: "a", 300: "b"})
    result = ldls.segment(points, wide, camera)
    with pytest.raises(LimitError, match="category 300"), LabelledBag(tmp_path / "a", "mcap") as bag:
        bag.write(result, HEADER)
