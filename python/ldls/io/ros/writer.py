"""Bags written whole or not at all."""

from __future__ import annotations

import errno
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ldls._optional import require
from ldls.checks import choice
from ldls.errors import InputError, UnsupportedFormatError
from ldls.io.ros.messages import Message, Topic, Types, serialize, standard_types

STORAGES = {"rosbag2": "SQLITE3", "mcap": "MCAP"}
KINDS = ("rosbag1", *STORAGES)
"""A ROS 1 file; a ROS 2 folder with SQLite storage; a ROS 2 folder with MCAP storage."""
UNFINISHED_BAG = ".part"
"""Ending of the folders in which bags are written."""
METADATA_VERSION = 8
"""Of metadata.yaml: the last that ROS 2 Humble and Jazzy both read."""


class BagWriter:
    """A bag to write to, beside `path` under another name until it is whole.

    When the block ends it takes the name `path`; if the block fails, nothing of it stays.

    Attributes:
        path: Where it will be: a file for "rosbag1", a folder for the others.
        kind: "rosbag1", "rosbag2" (SQLite) or "mcap".
        ros2: True if messages are serialised as ROS 2 does.
        types: The typestore of `rosbags` that messages are made with.
    """

    def __init__(self, path: str | PathLike[str], kind: str) -> None:
        """Prepare for a bag of a kind.

        Raises:
            ParameterError: There is no such kind.
            FileExistsError: There is something at `path` already.
            ImportError: The extra `ros` is not installed.
        """
        self.path, self.kind, self.ros2 = Path(path), choice("kind", kind, KINDS), kind != "rosbag1"
        if self.path.exists():
            raise FileExistsError(f"{self.path}: exists already; remove it or write to another name")
        self.types = standard_types(ros2=self.ros2)
        self._connections: dict[str, tuple[Any, str]] = {}

    def __enter__(self) -> Self:
        self._folder = Path(tempfile.mkdtemp(prefix=f".{self.path.name}.", suffix=UNFINISHED_BAG, dir=self.path.parent))
        try:
            with _names_bag(self.path):
                self._writer = self._opened(self._folder / self.path.name)
        except BaseException:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise
        return self

    def _opened(self, path: Path) -> Any:  # noqa: ANN401
        if not self.ros2:
            writer = require("rosbags.rosbag1", "ros").Writer(path)
        else:
            rosbag2 = require("rosbags.rosbag2", "ros")
            storage = getattr(rosbag2.StoragePlugin, STORAGES[self.kind])
            writer = rosbag2.Writer(path, version=METADATA_VERSION, storage_plugin=storage)
        writer.open()
        return writer

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None:
                with _names_bag(self.path):
                    self._writer.close()
                (self._folder / self.path.name).rename(self.path)
        finally:
            # closes what is open still; on a full disk this fails, too, and says less than what failed first
            with suppress(OSError, sqlite3.Error):
                self._writer.abort()
            shutil.rmtree(self._folder, ignore_errors=True)

    def add_topic(self, topic: Topic, types: Types | None = None) -> None:
        """Make ready for messages of a topic; `types` knows its type where it is none of ROS's own.

        Raises:
            InputError: There is such a topic already.
            UnsupportedFormatError: Its type is not known.
        """
        if topic.name in self._connections:
            raise InputError(f"topic {topic.name!r} is in the bag already; choose another name")
        known = self.types if types is None else types
        if topic.type not in known.fielddefs:
            raise UnsupportedFormatError(f"topic {topic.name!r} has the type {topic.type!r}, which is not known")
        add: Callable[..., Any] = self._writer.add_connection
        if self.ros2:
            profiles = [_keep_last(topic.latched)]
            connection = add(topic.name, topic.type, typestore=known, offered_qos_profiles=profiles)
        else:
            connection = add(topic.name, topic.type, typestore=known, latching=int(topic.latched))
        self._connections[topic.name] = (connection, topic.type)

    def write_message(self, topic: str, message: Message, received_ns: int) -> None:
        """Write a message as if received at that time."""
        kind = self._connections[topic][1]
        self.write_raw(topic, serialize(self.types, message, kind, ros2=self.ros2), received_ns)

    def write_raw(self, topic: str, raw: bytes, received_ns: int) -> None:
        """Write a serialised message as if received at that time.

        Raises:
            OSError: It cannot be written, as on a full disk.
        """
        with _names_bag(self.path):
            self._writer.write(self._connections[topic][0], received_ns, raw)


@contextmanager
def _names_bag(path: Path) -> Iterator[None]:
    """Give errors of writing the name of the bag; those of SQLite become errors of the system."""
    try:
        yield
    except sqlite3.Error as error:
        code = errno.ENOSPC if error.sqlite_errorname == "SQLITE_FULL" else errno.EIO
        raise _unwritten(path, code, str(error)) from error
    except OSError as error:
        raise _unwritten(path, error.errno, error.strerror or str(error)) from error


def _unwritten(path: Path, code: int | None, found: str) -> OSError:
    return OSError(code, f"{found} while writing the bag; free space, or write it to another disk", str(path))


def _keep_last(latched: bool) -> Any:  # noqa: ANN401
    """The quality of service that a topic offers: reliable, and kept for late subscribers if latched."""
    q = require("rosbags.interfaces", "ros")
    none = q.QosTime(0, 0)
    durability = q.QosDurability.TRANSIENT_LOCAL if latched else q.QosDurability.VOLATILE
    return q.Qos(
        q.QosHistory.KEEP_LAST, 10, q.QosReliability.RELIABLE, durability, none, none, q.QosLiveliness.AUTOMATIC, none,
        False,
    )  # fmt: skip
