"""The ROS messages that are read and written, and the typestores that know them.

A message is an object of `rosbags`, with the attributes that its definition names.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cache
from typing import Any

from ldls._optional import require
from ldls.errors import CorruptFileError

POINTS = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
ODOMETRY = "nav_msgs/msg/Odometry"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
OLD_TRANSFORMS = "tf/msg/tfMessage"
"""Name of the same message in early ROS 1."""
TRANSFORM_LIST = "geometry_msgs/TransformStamped[] transforms"
NANOSECONDS = 1_000_000_000

Message = Any
"""A deserialised message; `rosbags` comes without types for mypy."""
Types = Any
"""A typestore of `rosbags`."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: Its name, as "/camera/image_raw".
        type: Type of its messages, as "sensor_msgs/msg/Image".
        count: Number of its messages.
        latched: True if late subscribers are given the last message, as with /tf_static.
    """

    name: str
    type: str
    count: int
    latched: bool = False


@dataclass(frozen=True)
class RawMessage:
    """A message as it lies in a bag.

    Attributes:
        topic: Name of its topic.
        received_ns: Time of its recording, in nanoseconds.
        raw: The serialised message.
    """

    topic: str
    received_ns: int
    raw: bytes


@dataclass(frozen=True)
class Header:
    """Time and frame of a measurement.

    Attributes:
        stamp_ns: Time of measurement, in nanoseconds.
        frame_id: Name of the coordinate frame.
    """

    stamp_ns: int
    frame_id: str


def nanoseconds(stamp: Message) -> int:
    """The stamp (builtin_interfaces/Time) as one number."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def seconds(stamp_ns: int) -> str:
    """A stamp for people to read, to the nanosecond."""
    return f"{stamp_ns // NANOSECONDS}.{stamp_ns % NANOSECONDS:09d}"


def read_header(raw: bytes | memoryview, *, ros2: bool) -> Header:
    """The header with which a serialised message begins; nothing else of it is decoded.

    ROS 1 puts a sequence number first, ROS 2 four bytes of which the second's last bit says that it is little-endian
    (CDR, OMG's DDS-XTypes 7.6.2), and counts the NUL at the end of a text.

    Raises:
        CorruptFileError: The message is too short.
    """
    order = "<" if not ros2 or (raw[1:2] or b"\x01")[0] & 1 else ">"
    try:
        sec, nanosec, length = struct.unpack_from(f"{order}III", raw, 4)
    except struct.error:
        raise CorruptFileError(f"message of {len(raw)} bytes, expected a header of 16 or more") from None
    if len(raw) < 16 + length:
        raise CorruptFileError(f"message of {len(raw)} bytes, its frame_id alone has {length}")
    frame_id = bytes(raw[16 : 16 + length]).rstrip(b"\0").decode("utf-8", "replace")
    return Header(sec * NANOSECONDS + nanosec, frame_id)


@cache
def standard_types(*, ros2: bool) -> Types:
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


def make(types: Types, kind: str, /, **fields: object) -> Message:
    """A message of the type `kind`, as "sensor_msgs/msg/Image", from its fields."""
    return types.types[kind](**fields)


def make_header(types: Types, header: Header) -> Message:
    """A std_msgs/Header."""
    sec, nanosec = divmod(header.stamp_ns, NANOSECONDS)
    stamp = make(types, "builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    sequence = {"seq": 0} if "seq" in types.types["std_msgs/msg/Header"].__dataclass_fields__ else {}
    return make(types, "std_msgs/msg/Header", stamp=stamp, frame_id=header.frame_id, **sequence)


def serialize(types: Types, message: Message, kind: str, *, ros2: bool) -> bytes:
    """The bytes of a message in a bag."""
    return bytes(types.serialize_cdr(message, kind) if ros2 else types.serialize_ros1(message, kind))
