"""Bags opened for reading: ROS 1 files, ROS 2 folders, and bare storage files."""

from __future__ import annotations

import threading
import warnings
import weakref
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from operator import attrgetter
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ldls._optional import require
from ldls.errors import (
    CorruptFileError,
    FileFormatError,
    RecoveredFileWarning,
    TruncatedFileError,
    UnsupportedFormatError,
    within,
)
from ldls.io.files import opened, parsing
from ldls.io.names import name_order
from ldls.io.ros.messages import Message, RawMessage, Topic, Types, seconds, standard_types
from ldls.io.ros.salvage import NO_LIMIT, Salvage, check_database_size, open_bag_file, salvage

SUFFIXES = (".bag", ".db3", ".mcap")
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

        Other threads must not read meanwhile.

        Raises:
            CorruptFileError: The bag is damaged.
        """
        with _plain_errors(self.path):
            yield from self._read(topics, start_ns, stop_ns)

    def read_all(self, topics: Collection[str]) -> list[RawMessage]:
        """The messages of some topics in the order of their reception, read while no other thread does.

        Raises:
            CorruptFileError: The bag is damaged.
        """
        with self._lock:
            return list(self.messages(topics))

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
        with within(f"{self.path}: {topic}"), parsing(kind):
            return self.types.deserialize_cdr(raw, kind) if self.ros2 else self.types.deserialize_ros1(raw, kind)

    def close(self) -> None:
        """Close the files."""
        self._close()


def open_bag(path: Path, *, recover: bool = False) -> Bag:
    """The bag at `path`: a ROS 1 `.bag`, a ROS 2 folder with metadata.yaml, or a bare `.db3` or `.mcap`.

    Args:
        path: The bag.
        recover: If true, all of the bag is read to find out whether it is whole; one that is truncated or damaged, or
            whose recording was never closed, yields its whole messages and a warning instead of an error.

    Raises:
        TruncatedFileError: The index at the end of the bag is missing or damaged.
        CorruptFileError: It is no bag.
        UnsupportedFormatError: The suffix is none of a bag's.
        FileNotFoundError: There is no such file.
        ImportError: The extra `ros` is not installed.
    """
    require("rosbags.highlevel", "ros")
    files = storage_files(path)
    for file in (*files, *path.glob("metadata.yaml")):
        with open_bag_file(file):  # what is no regular file is refused before a library opens it
            pass
    bag, fault = _try_indexed(path, files)
    if bag is not None and not recover:
        return bag
    salvaged = salvage(files)
    if bag is not None and salvaged.damage is None:
        return bag
    if fault is not None and salvaged.damage is None and not salvaged.messages:
        raise fault
    damage = f"{path}: {salvaged.damage}" if salvaged.damage else str(fault)
    whole = salvaged.messages
    last = f"the last at {seconds(whole[-1].received_ns)}" if whole else "so nothing can be saved"
    message = f"{damage}; {len(whole)} whole messages before it, {last}"
    if not recover:
        mend = "; pass recover=True to read them" if whole else ""
        raise TruncatedFileError(message + mend) from fault
    warnings.warn(message, RecoveredFileWarning, stacklevel=3)
    if bag is not None:
        bag.close()
    return _recovered(path, salvaged, ros2=files[0].suffix != ".bag")


def _try_indexed(path: Path, files: Sequence[Path]) -> tuple[Bag | None, FileFormatError | None]:
    """The bag read through its index, or why it cannot be."""
    try:
        for file in files:
            if file.suffix == ".db3":
                check_database_size(file)
        return _indexed(path), None
    except FileFormatError as error:
        return None, error


class _BagPath(type(Path())):  # type: ignore[misc]
    """A path whose files the library reads through the one door: lengths that lie ask for no memory."""

    def open(self, mode: str = "r", *options: Any, **named: Any) -> Any:  # noqa: ANN401
        if mode != "rb":
            return super().open(mode, *options, **named)
        return opened(self, "bag", limit=NO_LIMIT)


def storage_files(path: Path) -> list[Path]:
    """The storage files of a bag, in the order of their names; none where they are compressed.

    Raises:
        UnsupportedFormatError: It is a file, and its suffix none of a bag's.
        FileNotFoundError: There is no such bag.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such bag")
    if path.is_dir():
        return sorted(
            (file for file in path.iterdir() if file.suffix in SUFFIXES), key=lambda file: name_order(file.name)
        )
    with open_bag_file(path):
        if path.suffix not in SUFFIXES:
            raise UnsupportedFormatError(f"expected a {', '.join(SUFFIXES)} file or a folder with metadata.yaml")
    return [path]


def _indexed(path: Path) -> Bag:
    """A whole bag, read through its index."""
    with _plain_errors(path):
        highlevel = require("rosbags.highlevel", "ros")
        types = standard_types(ros2=path.suffix != ".bag")
        reader = highlevel.AnyReader([_BagPath(path)], default_typestore=types)
        try:
            reader.open()
        except highlevel.AnyReaderError:
            # a type that nobody may ask for must not cost the others
            reader = highlevel.AnyReader([_BagPath(path)], default_typestore=types)
            reader.readers = [_KnownTypes(each) for each in reader.readers]
            reader.open()
        topics = {
            name: Topic(name, str(info.msgtype), int(info.msgcount), any(_is_latched(c.ext) for c in info.connections))
            for name, info in reader.topics.items()
        }

    def read(topics: Collection[str], start_ns: int | None, stop_ns: int | None) -> Iterator[RawMessage]:
        connections = [c for c in reader.connections if c.topic in topics]
        if not connections:  # the reader takes none for all
            return
        found, expected = 0, sum(int(c.msgcount) for c in connections)
        for found, (connection, received_ns, raw) in enumerate(  # noqa: B007 - counted for the check below
            reader.messages(connections, start_ns, stop_ns), start=1
        ):
            # a damaged database may hold a number, of which `bytes` would make as many zeros
            yield RawMessage(connection.topic, received_ns, bytes(memoryview(raw)))
        # the reader passes over records of a wrong length without a word
        if start_ns is None and stop_ns is None and found < expected:
            raise TruncatedFileError(
                f"holds {found} messages of {', '.join(topics)}, its index says {expected}; pass recover=True to read "
                "the whole ones"
            )

    return Bag(path, reader.typestore, topics, read, reader.close, ros2=bool(reader.is2))


class _KnownTypes:
    """A reader of `rosbags` whose connections lack the definitions that cannot be parsed, or are none of their type."""

    def __init__(self, reader: Any) -> None:  # noqa: ANN401
        """Stand in for `reader`."""
        self._reader = reader

    @property
    def connections(self) -> list[Any]:
        """Those of the reader; where the definition is of no use, without it."""
        interfaces = require("rosbags.interfaces", "ros")
        none = interfaces.MessageDefinition(interfaces.MessageDefinitionFormat.NONE, "")
        return [
            connection if _is_known(connection) else connection._replace(msgdef=none, digest="")
            for connection in self._reader.connections
        ]

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self._reader, name)

    def __enter__(self) -> Self:
        self._reader.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._reader.__exit__(kind, error, traceback)


def _is_known(connection: Any) -> bool:  # noqa: ANN401
    typesys = require("rosbags.typesys", "ros")
    formats = require("rosbags.interfaces", "ros").MessageDefinitionFormat
    if connection.msgdef.format != formats.MSG:
        return True
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    try:
        store.register(typesys.get_types_from_msg(connection.msgdef.data, connection.msgtype))
        ros2 = hasattr(connection.ext, "offered_qos_profiles")
        digest = store.hash_rihs01(connection.msgtype) if ros2 else store.generate_msgdef(connection.msgtype)[1]
    except Exception:
        return False
    return not connection.digest or bool(digest == connection.digest)


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
    with within(path), parsing("bag"):
        try:
            yield
        except FileNotFoundError as error:
            raise CorruptFileError(f"no metadata.yaml; was the recording closed? ({error})") from None
