"""The types of ROS messages, and messages made of them."""

from __future__ import annotations

from typing import Any

from ldls._optional import require
from ldls.io.ros.messages import NANOSECONDS, OLD_TRANSFORMS, TRANSFORMS, Header

TRANSFORM_LIST = "geometry_msgs/TransformStamped[] transforms"


def standard_types(*, ros2: bool) -> Any:  # noqa: ANN401
    """The typestore of `rosbags` with the messages that come with ROS.

    Raises:
        ImportError: The extra `ros` is not installed.
    """
    typesys = require("rosbags.typesys", "ros")
    types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE if ros2 else typesys.Stores.ROS1_NOETIC)
    for name in (TRANSFORMS, OLD_TRANSFORMS):
        if name not in types.fielddefs:
            types.register(typesys.get_types_from_msg(TRANSFORM_LIST, name))
    return types


def make(types: Any, kind: str, /, **fields: object) -> Any:  # noqa: ANN401
    """A message of the type `kind`, as "sensor_msgs/msg/Image", from its fields."""
    return types.types[kind](**fields)


def make_header(types: Any, header: Header) -> Any:  # noqa: ANN401
    """A std_msgs/Header."""
    sec, nanosec = divmod(header.stamp_ns, NANOSECONDS)
    stamp = make(types, "builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    sequence = {"seq": 0} if "seq" in types.types["std_msgs/msg/Header"].__dataclass_fields__ else {}
    return make(types, "std_msgs/msg/Header", stamp=stamp, frame_id=header.frame_id, **sequence)


def serialize(types: Any, message: object, name: str, *, ros2: bool) -> bytes:  # noqa: ANN401
    """A message as it lies in a bag."""
    return bytes(types.serialize_cdr(message, name) if ros2 else types.serialize_ros1(message, name))
