"""Whole messages of a ROS 1 bag, without its index.

Format: http://wiki.ros.org/Bags/Format/2.0. A file is a line of magic and records; a record is a header of
`name=value` fields and data, each after its length; chunks hold records of connections and messages.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from ldls.io.ros.messages import NANOSECONDS
from ldls.io.ros.salvage import Found, Salvage, Span

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, CHUNK, CONNECTION = 2, 3, 5, 7
Buffer = bytes | mmap.mmap
Record = tuple[dict[bytes, bytes], int, int]


def scan(path: Path, found: Salvage) -> str | None:
    """Add the whole messages of a file to `found`; how it ends if damaged, None if it is whole and indexed."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return f"does not begin with {MAGIC!r}, so it is no ROS 1 bag"
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return _scan(path, content, found)


def _scan(path: Path, content: mmap.mmap, found: Salvage) -> str | None:
    connections: dict[bytes, str] = {}
    end, indexed = len(MAGIC), True
    for header, start, size in _records(content, len(MAGIC)):
        kind, end = header[b"op"][0], start + size
        if kind == BAG_HEADER:
            indexed = header.get(b"index_pos", bytes(8)) != bytes(8)
        elif kind == CHUNK:
            chunk = Span(path, start, min(size, len(content) - start), header[b"compression"].decode())
            try:
                _read_chunk(chunk, connections, found)
            except ValueError as error:
                return f"chunk at byte {start}: {error}"
        else:
            _add(content, header, start, size, Span(path, 0, len(content)), connections, found)
        if end > len(content):
            return f"ends at byte {len(content)} within a record that goes on to {end}"
    if end != len(content):
        return f"ends at byte {len(content)} within the record at {end}"
    return None if indexed else "has no index, as its recording was not closed"


def _records(content: Buffer, start: int) -> Iterator[Record]:
    """Headers, and where the data lie, of the records from `start` on; the last may reach beyond the end."""
    while start + 4 <= len(content):
        (header_size,) = struct.unpack_from("<I", content, start)
        data = start + 4 + header_size
        if data + 4 > len(content):
            return
        header = _fields(content[start + 4 : data])
        if len(header.get(b"op", b"")) != 1:
            return
        (size,) = struct.unpack_from("<I", content, data)
        yield header, data + 4, size
        start = data + 4 + size


def _fields(content: bytes) -> dict[bytes, bytes]:
    fields, start = {}, 0
    while start + 4 <= len(content):
        (size,) = struct.unpack_from("<I", content, start)
        name, _, value = content[start + 4 : start + 4 + size].partition(b"=")
        fields[name] = value
        start += 4 + size
    return fields


def _read_chunk(chunk: Span, connections: dict[bytes, str], found: Salvage) -> None:
    content = chunk.read()
    for header, start, size in _records(content, 0):
        _add(content, header, start, size, chunk, connections, found)


def _add(
    content: Buffer,
    header: dict[bytes, bytes],
    start: int,
    size: int,
    span: Span,
    connections: dict[bytes, str],
    found: Salvage,
) -> None:
    """Take in a record of a connection or of a whole message."""
    if start + size > len(content):
        return
    if header[b"op"][0] == CONNECTION:
        topic = header[b"topic"].decode()
        package, _, name = _fields(content[start : start + size])[b"type"].decode().partition("/")
        connections[header[b"conn"]] = topic
        found.types[topic] = f"{package}/msg/{name}"
    elif header[b"op"][0] == MESSAGE and header[b"conn"] in connections:
        sec, nanosec = struct.unpack("<II", header[b"time"])
        read = partial(span.read_part, start, size)
        found.messages.append(Found(connections[header[b"conn"]], sec * NANOSECONDS + nanosec, read))
