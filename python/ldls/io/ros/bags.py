"""Bags opened for reading: ROS 1 files, ROS 2 folders, and bare storage files."""

from __future__ import annotations

import struct
import threading
import warnings
import weakref
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ldls._optional import require
from ldls.errors import (
    CorruptFileError,
    FileFormatError,
    RecoveredFileWarning,
    TruncatedFileError,
    UnsupportedFormatError,
)
from ldls.io.ros.messages import seconds
from ldls.io.ros.salvage import Salvage, salvage
from ldls.io.ros.salvage_db3 import check_size
from ldls.io.ros.types import standard_types

SUFFIXES = (".bag", ".db3", ".mcap")
BROKEN = (
    AssertionError, EOFError, IndexError, KeyError, OverflowError, RuntimeError, TypeError, ValueError, struct.error,
)  # fmt: skip
"""What readers of storage files raise over bytes that make no sense."""


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: Its name, as "/camera/image_raw".
        type: Type of its messages, as "sensor_msgs/msg/Image".
        count: How many there are.
        latched: Whether late subscribers are given the last message, as with /tf_static.
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
        received_ns: When it was recorded, in nanoseconds.
        raw: The serialised message.
    """

    topic: str
    received_ns: int
    raw: bytes


class Bag(Protocol):
    """A bag open for reading.

    Attributes:
        path: Where it lies.
        ros2: Whether its messages are serialised as ROS 2 does.
        types: The typestore of `rosbags` that knows its messages.
        topics: Its topics by name.
    """

    path: Path
    ros2: bool
    types: Any
    topics: dict[str, Topic]

    def messages(self, topics: Iterable[str]) -> Iterator[RawMessage]:
        """The messages of some topics in the order of their reception."""
        ...

    def read(self, topic: str, received_ns: int, rank: int = 0) -> bytes:
        """The message that is number `rank` among those of a topic received at that moment."""
        ...

    def close(self) -> None:
        """Close the files."""
        ...


def decode(bag: Bag, topic: str, raw: bytes) -> Any:  # noqa: ANN401
    """The message whose bytes are `raw`.

    Raises:
        CorruptFileError: The bytes are none of the topic's type.
    """
    kind = bag.topics[topic].type
    try:
        return bag.types.deserialize_cdr(raw, kind) if bag.ros2 else bag.types.deserialize_ros1(raw, kind)
    except (require("rosbags.serde", "ros").SerdeError, *BROKEN) as error:
        raise CorruptFileError(f"{bag.path}: {topic}: not a whole {kind} ({error})") from None


def open_bag(path: Path, *, recover: bool = False) -> Bag:
    """The bag at `path`: a ROS 1 `.bag`, a ROS 2 folder with metadata.yaml, or a bare `.db3` or `.mcap`.

    Args:
        path: The bag.
        recover: Whether a truncated bag, or one whose recording was never closed, yields its whole messages and a
            warning instead of an error.

    Raises:
        TruncatedFileError: The index at the end of the bag is missing or damaged.
        CorruptFileError: It is no bag.
        UnsupportedFormatError: The suffix is none of a bag's.
        FileNotFoundError: There is no such file.
        ImportError: The extra `ros` is not installed.
    """
    require("rosbags.highlevel", "ros")
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such bag")
    if path.is_file() and path.suffix not in SUFFIXES:
        raise UnsupportedFormatError(f"{path}: expected a {', '.join(SUFFIXES)} file or a folder with metadata.yaml")
    files = storage_files(path)
    try:
        for file in files:
            if file.suffix == ".db3":
                check_size(file)
        return _IndexedBag(path)
    except FileFormatError as error:
        found = salvage(files)
        if found.damage is None and not found.messages:
            raise
        damage = f"{path}: {found.damage}" if found.damage else str(error)
        return _salvaged(path, found, damage, recover)


def _salvaged(path: Path, found: Salvage, damage: str, recover: bool) -> Bag:
    last = f"the last at {seconds(found.messages[-1].received_ns)}" if found.messages else "so nothing can be saved"
    message = f"{damage}; {len(found.messages)} whole messages before it, {last}"
    if not recover:
        raise TruncatedFileError(f"{message}; pass recover=True to read them")
    warnings.warn(message, RecoveredFileWarning, stacklevel=4)
    return _SalvagedBag(path, found)


def storage_files(path: Path) -> list[Path]:
    """The storage files of a bag, in the order of their names; none where they are compressed."""
    if path.is_file():
        return [path]
    return sorted(file for file in path.iterdir() if file.suffix in SUFFIXES)


class _IndexedBag:
    """A whole bag, read through its index."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with _plain_errors(path):
            reader = require("rosbags.highlevel", "ros").AnyReader(
                [path], default_typestore=standard_types(ros2=path.suffix != ".bag")
            )
            reader.open()
        self._reader = reader
        # bags that nobody closes are closed with their last user
        self._close = weakref.finalize(self, reader.close)
        self._lock = threading.Lock()
        self.ros2 = bool(reader.is2)
        self.types = reader.typestore
        self.topics = {name: _topic(name, info) for name, info in reader.topics.items()}

    def messages(self, topics: Iterable[str]) -> Iterator[RawMessage]:
        wanted = set(topics)
        connections = [c for c in self._reader.connections if c.topic in wanted]
        if not connections:
            return
        with _plain_errors(self.path):
            for connection, received_ns, raw in self._reader.messages(connections):
                yield RawMessage(connection.topic, received_ns, bytes(raw))

    def read(self, topic: str, received_ns: int, rank: int = 0) -> bytes:
        connections = [c for c in self._reader.connections if c.topic == topic]
        with self._lock, _plain_errors(self.path):
            found = self._reader.messages(connections, start=received_ns, stop=received_ns + 1)
            for number, (_, _, raw) in enumerate(found):
                if number == rank:
                    return bytes(raw)
        raise CorruptFileError(f"{self.path}: {topic}: no message {rank} at {seconds(received_ns)}, but it was there")

    def close(self) -> None:
        self._close()


class _SalvagedBag:
    """The whole messages of a damaged bag, read from where a scan found them."""

    def __init__(self, path: Path, found: Salvage) -> None:
        self.path = path
        self.ros2 = found.ros2
        self.types = standard_types(ros2=found.ros2)
        self._messages = sorted(found.messages, key=lambda message: message.received_ns)
        counts: dict[str, int] = {}
        for message in self._messages:
            counts[message.topic] = counts.get(message.topic, 0) + 1
        self.topics = {
            name: Topic(name, kind, counts.get(name, 0), latched=name == "/tf_static")
            for name, kind in sorted(found.types.items())
        }

    def messages(self, topics: Iterable[str]) -> Iterator[RawMessage]:
        wanted = set(topics)
        for message in self._messages:
            if message.topic in wanted:
                yield RawMessage(message.topic, message.received_ns, message.read())

    def read(self, topic: str, received_ns: int, rank: int = 0) -> bytes:
        found = [m for m in self._messages if m.received_ns == received_ns and m.topic == topic]
        return found[rank].read()

    def close(self) -> None:
        """Nothing is open between reads."""


def _topic(name: str, info: Any) -> Topic:  # noqa: ANN401
    return Topic(name, str(info.msgtype), int(info.msgcount), any(_is_latched(c.ext) for c in info.connections))


def _is_latched(ext: Any) -> bool:  # noqa: ANN401
    if hasattr(ext, "latching"):
        return bool(ext.latching)
    return any(profile.durability.name == "TRANSIENT_LOCAL" for profile in ext.offered_qos_profiles)


@contextmanager
def _plain_errors(path: Path) -> Iterator[None]:
    """What readers say of damaged bags, as one kind of error."""
    readers = require("rosbags.highlevel", "ros")
    storages = (require("rosbags.rosbag1", "ros").ReaderError, require("rosbags.rosbag2", "ros").ReaderError)
    typesys = require("rosbags.typesys", "ros").TypesysError
    others = (require("apsw", "ros").Error, require("rosbags.rosbag2.reader", "ros").zstd.ZstdError)
    try:
        yield
    except FileNotFoundError as error:
        raise CorruptFileError(f"{path}: no metadata.yaml; was the recording closed? ({error})") from None
    except OSError as error:
        # bz2 says so of data that it cannot decompress, without the number that a disk's errors have
        if error.errno is not None:
            raise
        raise CorruptFileError(f"{path}: cannot be read as a bag ({error})") from None
    except (readers.AnyReaderError, *storages, typesys, *others, *BROKEN) as error:
        raise CorruptFileError(f"{path}: cannot be read as a bag ({error or type(error).__name__})") from None
