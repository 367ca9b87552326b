"""The whole messages of a bag that is cut off.

`rosbags` finds messages by the index at the end of a bag, and SQLite opens no file that is shorter than it says; so
records and rows are read here one after the other, as far as they are whole.

Formats: http://wiki.ros.org/Bags/Format/2.0, https://mcap.dev/spec, https://sqlite.org/fileformat2.html.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass, field
from functools import cache, partial
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from ldls._optional import require
from ldls.errors import FileFormatError, TruncatedFileError
from ldls.io.files import InputFile, open_file

NO_LIMIT = sys.maxsize
"""Bags are as large as disks are; what is read of one at once is no larger than a chunk."""
WHOLE_PAGES = "ldls-whole-pages"
TOPICS = "SELECT id, name, type FROM topics WHERE typeof(name) = 'text' AND typeof(type) = 'text'"
MESSAGES = "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id"
"""Rows of a database; data are read so that those cut short count as damaged."""


class FileBytes:
    """The bytes of a file by slices, as of those in memory; none is read before it is asked for."""

    def __init__(self, file: InputFile) -> None:
        """The bytes of an open file."""
        self._file = file

    def __len__(self) -> int:
        return self._file.size

    def __getitem__(self, part: slice) -> bytes:
        start, stop, _ = part.indices(self._file.size)
        self._file.seek(start)
        return self._file.read(max(stop - start, 0))


Content = bytes | FileBytes


class WholeMessage(NamedTuple):
    """A message: its topic, its time of reception in nanoseconds, and a function that reads its bytes."""

    topic: str
    received_ns: int
    read: Callable[[], bytes]


@dataclass
class Salvage:
    """The whole messages of the storage files of a bag.

    Attributes:
        types: Type of the messages of each topic.
        messages: The messages in the order of their reception.
        damage: End of the first damaged file, in words; None if none is damaged.
    """

    types: dict[str, str] = field(default_factory=dict)
    messages: list[WholeMessage] = field(default_factory=list)
    damage: str | None = None


def salvage(files: Sequence[Path]) -> Salvage:
    """The whole messages of storage files."""
    salvaged = Salvage()
    for path in files:
        try:
            with open_bag_file(path) as file:
                damage = SCANS[path.suffix](path, salvaged).run(FileBytes(file))
        except FileFormatError as error:
            damage = f"holds a record that makes no sense ({error})"
        if damage and salvaged.damage is None:
            salvaged.damage = f"{path.name}: {damage}" if len(files) > 1 else damage
    salvaged.messages.sort(key=lambda message: message.received_ns)
    return salvaged


def open_bag_file(path: Path) -> AbstractContextManager[InputFile]:
    """A storage file, opened through the one door for files."""
    return open_file(path, "bag", limit=NO_LIMIT)


class _Chunk(NamedTuple):
    """Records in a file, perhaps compressed."""

    path: Path
    start: int
    size: int
    compression: str = ""

    def read(self) -> bytes:
        """The records, decompressed.

        Raises:
            TruncatedFileError: The file has become shorter.
            CorruptFileError: They cannot be decompressed.
        """
        with open_bag_file(self.path) as file:
            content = FileBytes(file)[self.start : self.start + self.size]
            if len(content) != self.size:
                raise TruncatedFileError(f"ends within a message at byte {self.start}, where it was whole")
            if not self.compression:
                return content
            module = {"bz2": "bz2", "lz4": "lz4.frame", "zstd": "rosbags.rosbag2.reader"}[self.compression]
            library = require(module, "ros")
            return bytes(getattr(library, "zstd", library).decompress(content))

    def read_part(self, start: int, size: int) -> bytes:
        """`size` bytes from `start` on, both counted after decompression."""
        if self.compression:
            return self.read()[start : start + size]
        return self._replace(start=self.start + start, size=size).read()


class _Scan:
    """A pass over a file of records, of which chunks hold further records."""

    name: ClassVar[str]
    magic: ClassVar[bytes]

    def __init__(self, path: Path, salvaged: Salvage) -> None:
        self.path, self.salvaged = path, salvaged
        self.topics: dict[int, str] = {}
        self.schemas: dict[int, str] = {}
        self.closed = False
        self.damage_in_chunk: str | None = None

    def run(self, content: FileBytes) -> str | None:
        """Take in the whole messages; the end of the file in words, None if it is whole."""
        if content[: len(self.magic)] != self.magic:
            return f"does not begin with {self.magic!r}, so it is no {self.name}"
        damage = self.take(content, len(self.magic), _Chunk(self.path, 0, len(content))) or self.damage_in_chunk
        return damage or (None if self.closed else "has no index, as its recording was not closed")

    def take(self, content: Content, start: int, place: _Chunk) -> str | None:
        """Take in the whole messages from `start` on of `content`, which lies at `place`; None if it is all whole."""
        raise NotImplementedError

    def take_chunk(self, start: int, size: int, left: int, compression: str) -> None:
        """Take in the whole messages of a chunk, of which `left` bytes are in the file."""
        chunk = _Chunk(self.path, start, min(size, left), compression.replace("none", ""))
        if size > left and chunk.compression:  # a part of compressed bytes is good for nothing
            return
        damage = self.take(chunk.read(), 0, chunk)
        if self.damage_in_chunk is None and damage is not None:
            self.damage_in_chunk = f"the chunk at byte {start} {damage}"

    def add(self, channel: int, received_ns: int, read: Callable[[], bytes]) -> None:
        """Take in a whole message."""
        if channel in self.topics:
            self.salvaged.messages.append(WholeMessage(self.topics[channel], received_ns, read))


class _Rosbag1(_Scan):
    """A ROS 1 bag: a record is a header of `name=value` fields and data, each after its length."""

    name, magic = "ROS 1 bag", b"#ROSBAG V2.0\n"

    def take(self, content: Content, start: int, place: _Chunk) -> str | None:
        while start + 4 <= len(content):
            (header_size,) = _unpack("<I", content, start)
            data = start + 8 + header_size
            if data > len(content) or header_size == 0:
                break
            header = _fields(content[start : data - 4])
            (size,) = _unpack("<I", content, data - 4)
            start = data + size
            self.take_record(header, content, place, data, size)
            if start > len(content):
                return f"ends at byte {len(content)} within a record that goes on to {start}"
        return None if start == len(content) else f"ends at byte {len(content)} within the record at {start}"

    def take_record(self, header: Any, content: Content, place: _Chunk, start: int, size: int) -> None:  # noqa: ANN401
        kind, left = header.get_uint8("op"), len(content) - start
        if kind == 5 and place.start == 0:  # a chunk, which holds no chunks
            self.take_chunk(start, size, left, header.get_string("compression"))
        elif kind == 3:  # the header of the bag
            self.closed = header.get_uint64("index_pos") != 0
        elif kind == 7 and size <= left:  # a connection
            topic = self.topics[header.get_uint32("conn")] = header.get_string("topic")
            kind = _fields(content[start - 4 : start + size]).get_string("type")
            self.salvaged.types[topic] = kind.replace("/", "/msg/")
        elif kind == 2 and size <= left:  # a message
            self.add(header.get_uint32("conn"), header.get_time("time"), partial(place.read_part, start, size))


def _fields(content: bytes) -> Any:  # noqa: ANN401
    """The fields of a ROS 1 record, from their length on."""
    return require("rosbags.rosbag1.reader", "ros").Header.read(BytesIO(content))


class _Mcap(_Scan):
    """An MCAP file: a record is its kind, a length of 64 bits and data."""

    name, magic = "MCAP file", b"\x89MCAP0\r\n"

    def take(self, content: Content, start: int, place: _Chunk) -> str | None:
        while start + 9 <= len(content):
            kind, size = _unpack("<BQ", content, start)
            data, start = start + 9, start + 9 + size
            if kind == 2:  # the footer
                self.closed = True
                return None
            self.take_record(kind, content, place, data, size)
            if start > len(content):
                return f"ends at byte {len(content)} within a record that goes on to {start}"
        return None if start == len(content) else f"ends at byte {len(content)} within the record at {start}"

    def take_record(self, kind: int, content: Content, place: _Chunk, start: int, size: int) -> None:
        if kind == 6 and place.start == 0:  # a chunk: times, size, checksum, compression, compressed size, records
            compression, records = _text(content, start + 28)
            self.take_chunk(records + 8, start + size - records - 8, len(content) - records - 8, compression)
        elif start + size > len(content):
            return
        elif kind == 3:  # a schema
            (number,) = _unpack("<H", content, start)
            self.schemas[number], _ = _text(content, start + 2)
        elif kind == 4:  # a channel
            number, schema = _unpack("<HH", content, start)
            topic, _ = _text(content, start + 4)
            self.topics[number], self.salvaged.types[topic] = topic, self.schemas.get(schema, "")
        elif kind == 5:  # a message: channel, number, time of reception, time of sending, then its data
            channel, _, received_ns, _ = _unpack("<HIQQ", content, start)
            self.add(channel, received_ns, partial(place.read_part, start + 22, size - 22))


def _unpack(layout: str, content: Content, start: int) -> tuple[int, ...]:
    """The whole numbers that lie at `start`."""
    return struct.unpack(layout, content[start : start + struct.calcsize(layout)])


def _text(content: Content, start: int) -> tuple[str, int]:
    """The text whose length is at `start`, and where it ends."""
    end = start + 4 + int.from_bytes(content[start : start + 4], "little")
    return content[start + 4 : end].decode(), end


def check_database_size(path: Path) -> None:
    """Refuse an SQLite file that is shorter than its header says; SQLite finds out only at the pages that are missing.

    Raises:
        TruncatedFileError: It is shorter.
    """
    with open_bag_file(path) as file:
        header = file.read(100)
        changes, pages, valid_for = (int.from_bytes(header[start : start + 4]) for start in (24, 28, 92))
        expected = pages * _page_size(header[16:18])
        # the number of pages holds if the last writer kept it up to date
        if changes == valid_for and file.size < expected:
            raise TruncatedFileError(f"ends at byte {file.size}, expected {expected}")


def _page_size(field: bytes) -> int:
    """Bytes of a page, 1 where the field holds none: SQLite says that this is no database."""
    size = int.from_bytes(field)
    return 65536 if size == 1 else max(size, 1)


class _Database(_Scan):
    """An SQLite file, of which rows are read as long as they hold."""

    name, magic = "SQLite file", b"SQLite format 3\0"

    def take(self, content: Content, start: int, place: _Chunk) -> str | None:
        try:
            with closing(self.connect()) as connection:
                for number, topic, kind in connection.execute(TOPICS):
                    self.topics[number], self.salvaged.types[topic] = topic, kind
                n_broken = 0
                for number, topic_number, received_ns, raw in connection.execute(MESSAGES):
                    # pages full of zeros hold NULL
                    if isinstance(received_ns, int) and isinstance(raw, bytes):
                        self.add(topic_number, received_ns, partial(self.read, number))
                    else:
                        n_broken += 1
        except require("apsw", "ros").Error as error:
            return f"SQLite finds it damaged ({error})"
        self.closed = True
        return f"holds {n_broken} messages that are no bytes, or of no time" if n_broken else None

    def read(self, number: int) -> bytes:
        """The message of a row."""
        with closing(self.connect()) as connection:
            ((raw,),) = connection.execute("SELECT data FROM messages WHERE id = ?", (number,))
        return bytes(raw)

    def connect(self) -> Any:  # noqa: ANN401
        """The file, opened for reading although it may be shorter than its header says."""
        apsw = require("apsw", "ros")
        _whole_pages()
        flags = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
        connection = apsw.Connection(f"{self.path.resolve().as_uri()}?immutable=1", flags=flags, vfs=WHOLE_PAGES)
        connection.execute("PRAGMA writable_schema = ON")
        return connection


@cache
def _whole_pages() -> Any:  # noqa: ANN401
    """Files without their last page where it is cut: SQLite would take what is missing for zeros."""
    apsw = require("apsw", "ros")

    class File(apsw.VFSFile):  # type: ignore[misc, name-defined]
        def xFileSize(self) -> int:
            size: int = super().xFileSize()
            return size - size % _page_size(self.xRead(2, 16))

    class Files(apsw.VFS):  # type: ignore[misc, name-defined]
        def xOpen(self, name: str, flags: list[int]) -> File:
            return File("", name, flags)

    return Files(WHOLE_PAGES, "")


SCANS = {".bag": _Rosbag1, ".db3": _Database, ".mcap": _Mcap}
