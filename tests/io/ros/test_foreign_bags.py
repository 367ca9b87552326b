"""Bags of others, and types that cannot be parsed."""

from collections import Counter
from contextlib import closing

import pytest

import ldls
from ldls.io.ros.bags import open_bag
from ldls.io.ros.messages import standard_types

rosbag1 = pytest.importorskip("rosbags.rosbag1", reason="the extra ros is not installed")


def test_a_type_that_cannot_be_parsed_costs_its_own_topic_alone(tmp_path):
    path = tmp_path / "a.bag"
    types = standard_types(ros2=False)
    with rosbag1.Writer(path) as writer:
        known = writer.add_connection("/lamp", "std_msgs/msg/Bool", typestore=types)
        unknown = writer.add_connection("/arm", "maker/msg/Arm", msgdef="not { a definition", md5sum="53" * 16)
        empty = writer.add_connection("/led", "maker/msg/Led", msgdef="", md5sum="53" * 16)
        for number, connection in enumerate((known, unknown, empty, known), start=1):
            writer.write(connection, number, b"\1")
    with closing(open_bag(path)) as bag:
        assert {name: (topic.type, topic.count) for name, topic in bag.topics.items()} == {
            "/arm": ("maker/msg/Arm", 1), "/lamp": ("std_msgs/msg/Bool", 2), "/led": ("maker/msg/Led", 1),
        }  # fmt: skip
        assert [bag.decode(found.topic, found.raw).data for found in bag.messages(["/lamp"])] == [True, True]
        (raw,) = bag.messages(["/arm"])
        with pytest.raises(ldls.CorruptFileError, match=r"a\.bag: /arm: not a whole maker/msg/Arm"):
            bag.decode("/arm", raw.raw)


@pytest.mark.parametrize("name", ["bag-with-empty-message-definition.bag", "only_services.mcap", "luminar.bag"])
def test_bags_of_others_are_opened(data_folder, name):
    with closing(open_bag(data_folder / "real/bags" / name)) as bag:
        found = Counter(message.topic for message in bag.messages(bag.topics))
        assert found == {name: topic.count for name, topic in bag.topics.items()}
