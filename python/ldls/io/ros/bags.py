"""Bags opened for reading: ROS 1 files, ROS 2 folders, and bare storage files."""

from __future__ import annotations

import struct
import threading
import warnings
import weakref
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import Any

from ldls._optional import require
from ldls.errors import (
    CorruptFileError,
    FileFormatError,
    RecoveredFileWarning,
    TruncatedFileError,
    UnsupportedFormatError,
)
from ldls.io.ros.messages import Message, RawMessage, Topic, Types, seconds, standard_types
from ldls.io.ros.salvage import Salvage, check_database_size, salvage

SUFFIXES = (".bag", ".db3", ".mcap")
BROKEN = (
    AssertionError, EOFError, IndexError, KeyError, OverflowError, RuntimeError, TypeError, ValueError, struct.error,
)  # fmt: skip
"""Errors of readers of storage files over bytes that make no sense."""
Read = Callable[[Collection[str], int | None, int | None], Iterator[RawMessage]]
"""Reads the messages of some topics that were received from one time on and before another, in that order."""


class Bag:
    """A bag open for reading.

    Attributes:
        path: Its file or folder.
        ros2: True if its messages are serialised as ROS 2 does.
        types: The typestore that knows its messages.
        topics: Its topics by name.
    """

    def __init__(
        self,
        path: Path,
        types: Types,
        topics: dict[str, Topic],
        read: Read,
        close: Callable[[], None] = lambda: None,
        *,
        ros2: bool,
    ) -> None:
        self.path, self.types, self.topics, self.ros2 = path, types, topics, ros2
        self._read = read
        # bags that nobody closes are closed with their last user
        self._close = weakref.finalize(self, close)
        self._lock = threading.Lock()

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """The messages of some topics in the order of their reception, all or those in [start_ns, stop_ns).

        Raises:
            CorruptFileError: The bag is damaged.
        """
        with _plain_errors(self.path):
            yield from self._read(topics, start_ns, stop_ns)

    def read(self, topic: str, received_ns: int, rank: int = 0) -> bytes:
        """The message that is number `rank` among those of a topic received at that moment.

        Raises:
            CorruptFileError: The bag is damaged.
        """
        with self._lock:  # readers of bags seek in one file
            for number, message in enumerate(self.messages([topic], received_ns, received_ns + 1)):
                if number == rank:
                    return message.raw
        raise CorruptFileError(f"{self.path}: {topic}: no message {rank} at {seconds(received_ns)}, but it was there")

    def decode(self, topic: str, raw: bytes) -> Message:
        """The message whose bytes are `raw`.

        Raises:
            CorruptFileError: The bytes are none of the topic's type.
        """
        kind = self.topics[topic].type
        try:
            return self.types.deserialize_cdr(raw, kind) if self.ros2 else self.types.deserialize_ros1(raw, kind)
        except (require("rosbags.serde", "ros").SerdeError, *BROKEN) as error:
            raise CorruptFileError(f"{self.path}: {topic}: not a whole {kind} ({error})") from None

    def close(self) -> None:
        """Close the files."""
        self._close()


def open_bag(path: Path, *, recover: bool = False) -> Bag:
    """The bag at `path`: a ROS 1 `.bag`, a ROS 2 folder with metadata.yaml, or a bare `.db3` or `.mcap`.

    Args:
        path: The bag.
        recover: If true, a truncated bag, or one whose recording was never closed, yields its whole messages and a
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
                check_database_size(file)
        return _indexed(path)
    except FileFormatError as error:
        salvaged = salvage(files)
        if salvaged.damage is None and not salvaged.messages:
            raise
        damage = f"{path}: {salvaged.damage}" if salvaged.damage else str(error)
        whole = salvaged.messages
        last = f"the last at {seconds(whole[-1].received_ns)}" if whole else "so nothing can be saved"
        message = f"{damage}; {len(whole)} whole messages before it, {last}"
        if not recover:
            raise TruncatedFileError(f"{message}; pass recover=True to read them") from error
        warnings.warn(message, RecoveredFileWarning, stacklevel=3)
        return _recovered(path, salvaged, ros2=files[0].suffix != ".bag")


def storage_files(path: Path) -> list[Path]:
    """The storage files of a bag, in the order of their names; none where they are compressed."""
    if path.is_file():
        return [path]
    return sorted(file for file in path.iterdir() if file.suffix in SUFFIXES)


def _indexed(path: Path) -> Bag:
    """A whole bag, read through its index."""
    with _plain_errors(path):
        reader = require("rosbags.highlevel", "ros").AnyReader(
            [path], default_typestore=standard_types(ros2=path.suffix != ".bag")
        )
        reader.open()

    def read(topics: Collection[str], start_ns: int | None, stop_ns: int | None) -> Iterator[RawMessage]:
        connections = [c for c in reader.connections if c.topic in topics]
        if connections:  # the reader takes none for all
            for connection, received_ns, raw in reader.messages(connections, start_ns, stop_ns):
                yield RawMessage(connection.topic, received_ns, bytes(raw))

    topics = {
        name: Topic(name, str(info.msgtype), int(info.msgcount), any(_is_latched(c.ext) for c in info.connections))
        for name, info in reader.topics.items()
    }
    return Bag(path, reader.typestore, topics, read, reader.close, ros2=bool(reader.is2))


def _is_latched(ext: Any) -> bool:  # noqa: ANN401
    if hasattr(ext, "latching"):
        return bool(ext.latching)
    return any(profile.durability.name == "TRANSIENT_LOCAL" for profile in ext.offered_qos_profiles)


def _recovered(path: Path, salvaged: Salvage, *, ros2: bool) -> Bag:
    """The whole messages of a damaged bag; nothing is open between reads."""

    def read(topics: Collection[str], start_ns: int | None, stop_ns: int | None) -> Iterator[RawMessage]:
        first = 0 if start_ns is None else bisect_left(salvaged.messages, start_ns, key=attrgetter("received_ns"))
        for message in islice(salvaged.messages, first, None):
            if stop_ns is not None and message.received_ns >= stop_ns:
                return
            if message.topic in topics:
                yield RawMessage(message.topic, message.received_ns, message.read())

    counts = Counter(message.topic for message in salvaged.messages)
    topics = {
        name: Topic(name, kind, counts[name], latched=name == "/tf_static")
        for name, kind in sorted(salvaged.types.items())
    }
    return Bag(path, standard_types(ros2=ros2), topics, read, ros2=ros2)


@contextmanager
def _plain_errors(path: Path) -> Iterator[None]:
    """One kind of error for damaged bags, whatever their reader raises."""
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
