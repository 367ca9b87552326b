"""Poses of a robot from messages of nav_msgs/Odometry.

Source: https://docs.ros.org/en/noetic/api/nav_msgs/html/msg/Odometry.html: the pose is that of `child_frame_id` in
`header.frame_id`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ldls.cloud import Floats
from ldls.datasets.ros_transforms import matrix_of, plain
from ldls.errors import CalibrationError, PoseError, within
from ldls.io.ros.bags import Bag
from ldls.io.ros.messages import NANOSECONDS, ODOMETRY, Message, nanoseconds, read_header, seconds
from ldls.sequences import Trajectory


@dataclass(frozen=True)
class Odometry:
    """The way of a robot, as a topic has it.

    Attributes:
        topic: The topic.
        robot: The frame whose poses they are.
        way: Its poses.
    """

    topic: str
    robot: str
    way: Trajectory

    def way_of(self, T_robot_lidar: Floats, start: float, end: float) -> Trajectory:
        """The way of the lidar from one moment, in seconds, to another, and the poses beside."""
        first = max(int(np.searchsorted(self.way.stamps, start, side="right")) - 2, 0)
        last = int(np.searchsorted(self.way.stamps, end)) + 2
        return Trajectory(self.way.stamps[first:last], self.way.poses[first:last] @ T_robot_lidar)


def odometry_topics(bag: Bag) -> list[str]:
    """The topics of nav_msgs/Odometry."""
    return [topic.name for topic in bag.topics.values() if topic.type == ODOMETRY]


def read_odometry(bag: Bag, world: str) -> Odometry | None:
    """The way of the robot in the frame `world`, or as the topic `world` has it; None without any message of this type.

    Raises:
        PoseError: No topic, or more than one, has poses in that frame; or they are of several robots or of none, or
            are no way of a robot. The message has the topic, and the stamp where there is one.
        CorruptFileError: A message cannot be read.
    """
    topics = odometry_topics(bag)
    messages: dict[str, dict[str, list[bytes]]] = {topic: defaultdict(list) for topic in topics}
    for message in bag.read_all(topics):
        header = read_header(message.raw, ros2=bag.ros2)
        messages[message.topic][plain(header.frame_id)].append(message.raw)
    topic, raw = _of_topic(world, messages[world]) if world in messages else _in_frame(world, messages)
    if topic is None:
        return None
    with within(topic):
        # one at a time: messages are larger than their poses
        return _way(topic, (bag.decode(topic, one) for one in raw))


def _of_topic(topic: str, by_world: Mapping[str, list[bytes]]) -> tuple[str, list[bytes]]:
    """The topic and its messages."""
    if len(by_world) != 1:
        found = f"poses in {_listed(by_world)}" if by_world else "no messages"
        raise PoseError(f"world: {topic} has {found}, expected poses in one frame; choose that frame, or another topic")
    return topic, next(iter(by_world.values()))


def _in_frame(world: str, messages: Mapping[str, Mapping[str, list[bytes]]]) -> tuple[str | None, list[bytes]]:
    """The topic that has poses in a frame, and these messages; None where no topic has any message."""
    topics = [topic for topic, by_world in messages.items() if plain(world) in by_world]
    if len(topics) == 1:
        return topics[0], messages[topics[0]][plain(world)]
    if topics:
        raise PoseError(f"world: {', '.join(topics)} have poses in {world!r}; choose one of them, as world={topics[0]}")
    found = [f"{topic} has poses in {_listed(by_world)}" for topic, by_world in messages.items() if by_world]
    if found:
        raise PoseError(
            f"world: neither transforms nor nav_msgs/Odometry have poses in {world!r}; {'; '.join(found)}; "
            "choose another world"
        )
    return None, []


def _way(topic: str, messages: Iterable[Message]) -> Odometry:
    robots, stamps, poses, world = set(), [], [], ""
    for message in messages:
        world = plain(message.header.frame_id)
        robots.add(plain(message.child_frame_id))
        stamps.append(nanoseconds(message.header.stamp))
        poses.append(_pose(message))
    robot = next(iter(robots))
    # some write the frame of the poses here, too
    if len(robots) != 1 or robot in ("", world):
        raise PoseError(
            f"child_frame_id is {_listed(robots)}, expected the name of one frame that moves with the lidar; choose "
            "another world, or give poses of a file"
        )
    # messages may come late, and twice
    stamps_ns, first = np.unique(np.array(stamps, np.int64), return_index=True)
    return Odometry(topic, robot, Trajectory(stamps_ns / NANOSECONDS, np.array(poses)[first]))


def _pose(message: Message) -> Floats:
    """(4, 4) from coordinates of the robot to those of the world."""
    pose = message.pose.pose
    try:
        return matrix_of("orientation", pose.orientation, pose.position)
    except CalibrationError as error:
        raise PoseError(f"pose at {seconds(nanoseconds(message.header.stamp))} s: {error}") from None


def _listed(names: Iterable[str]) -> str:
    return " and ".join(repr(name) for name in sorted(names))
