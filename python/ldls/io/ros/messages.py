"""The ROS messages that are read and written, as far as they are used, and where their fields differ."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError

POINTS = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
OLD_TRANSFORMS = "tf/msg/tfMessage"
"""What early ROS 1 calls the same message."""
NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class Header:
    """When and in which frame something was measured.

    Attributes:
        stamp_ns: Time of measurement, in nanoseconds.
        frame_id: Name of the coordinate frame.
    """

    stamp_ns: int
    frame_id: str


class TimeMessage(Protocol):
    """builtin_interfaces/Time."""

    sec: int
    nanosec: int


class HeaderMessage(Protocol):
    """std_msgs/Header."""

    stamp: TimeMessage
    frame_id: str


class FieldMessage(Protocol):
    """sensor_msgs/PointField."""

    name: str
    offset: int
    datatype: int
    count: int


class PointsMessage(Protocol):
    """sensor_msgs/PointCloud2."""

    header: HeaderMessage
    height: int
    width: int
    fields: Sequence[FieldMessage]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8]
    is_dense: bool


class ImageMessage(Protocol):
    """sensor_msgs/Image."""

    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: NDArray[np.uint8]


class CompressedImageMessage(Protocol):
    """sensor_msgs/CompressedImage."""

    format: str
    data: NDArray[np.uint8]


class RegionMessage(Protocol):
    """sensor_msgs/RegionOfInterest."""

    x_offset: int
    y_offset: int
    height: int
    width: int


class InfoMessage(Protocol):
    """sensor_msgs/CameraInfo; its matrices are D, K, R and P in ROS 1 and d, k, r and p in ROS 2."""

    height: int
    width: int
    distortion_model: str
    binning_x: int
    binning_y: int
    roi: RegionMessage


class VectorMessage(Protocol):
    """geometry_msgs/Vector3."""

    x: float
    y: float
    z: float


class QuaternionMessage(VectorMessage, Protocol):
    """geometry_msgs/Quaternion."""

    w: float


class RigidMessage(Protocol):
    """geometry_msgs/Transform."""

    translation: VectorMessage
    rotation: QuaternionMessage


class StampedTransformMessage(Protocol):
    """geometry_msgs/TransformStamped."""

    header: HeaderMessage
    child_frame_id: str
    transform: RigidMessage


class TransformsMessage(Protocol):
    """tf2_msgs/TFMessage."""

    transforms: Sequence[StampedTransformMessage]


def nanoseconds(stamp: TimeMessage) -> int:
    """A stamp as one number."""
    return stamp.sec * NANOSECONDS + stamp.nanosec


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
    order = "<" if not ros2 or raw[1:2] in (b"", b"\x01") or bytes(raw[1:2])[0] & 1 else ">"
    try:
        sec, nanosec, length = struct.unpack_from(f"{order}III", raw, 4)
    except struct.error:
        raise CorruptFileError(f"message of {len(raw)} bytes, expected a header of 16 or more") from None
    if len(raw) < 16 + length:
        raise CorruptFileError(f"message of {len(raw)} bytes, its frame_id alone has {length}")
    frame_id = bytes(raw[16 : 16 + length]).rstrip(b"\0").decode("utf-8", "replace")
    return Header(sec * NANOSECONDS + nanosec, frame_id)
