"""Whole messages of an MCAP file, without its index.

Format: https://mcap.dev/spec. Records are an opcode, a length of 64 bits and content; chunks hold records of schemas,
channels and messages.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from ldls.io.ros.salvage import Found, Salvage, Span

MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
RECORD_HEADER = struct.Struct("<BQ")
MESSAGE_HEADER = struct.Struct("<HIQQ")
Buffer = bytes | mmap.mmap


def scan(path: Path, found: Salvage) -> str | None:
    """Add the whole messages of a file to `found`; how it ends if damaged, None if it is whole."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return f"does not begin with {MAGIC!r}, so it is no MCAP file"
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return _Scan(path, found).run(content)


class _Scan:
    """One pass over a file."""

    def __init__(self, path: Path, found: Salvage) -> None:
        self.path = path
        self.found = found
        self.schemas: dict[int, str] = {}
        self.topics: dict[int, str] = {}

    def run(self, content: mmap.mmap) -> str | None:
        whole = Span(self.path, 0, len(content))
        for kind, start, size in _records(content, len(MAGIC)):
            if kind == FOOTER:
                return None
            if kind == CHUNK:
                try:
                    self.read_chunk(content, start, size)
                except ValueError as error:
                    return f"chunk at byte {start}: {error}"
            else:
                self.add(content, whole, kind, start, size)
            if start + size > len(content):
                return f"ends at byte {len(content)} within a record that goes on to {start + size}"
        return f"ends at byte {len(content)} without a footer"

    def read_chunk(self, content: Buffer, start: int, size: int) -> None:
        """Take in the records of a chunk: times, size, checksum, compression, then the records."""
        (name_size,) = struct.unpack_from("<I", content, start + 28)
        compression = content[start + 32 : start + 32 + name_size].decode()
        data = start + 32 + name_size + 8
        chunk = Span(self.path, data, min(start + size, len(content)) - data, compression)
        records = chunk.read()
        for kind, at, length in _records(records, 0):
            self.add(records, chunk, kind, at, length)

    def add(self, content: Buffer, span: Span, kind: int, start: int, size: int) -> None:
        """Take in a record of a schema, a channel or a whole message."""
        if start + size > len(content):
            return
        if kind == SCHEMA:
            (number,) = struct.unpack_from("<H", content, start)
            self.schemas[number] = _text(content, start + 2)
        elif kind == CHANNEL:
            number, schema = struct.unpack_from("<HH", content, start)
            topic = self.topics[number] = _text(content, start + 4)
            self.found.types[topic] = self.schemas.get(schema, "")
        elif kind == MESSAGE:
            channel, _, received_ns, _ = MESSAGE_HEADER.unpack_from(content, start)
            if channel in self.topics:
                read = partial(span.read_part, start + MESSAGE_HEADER.size, size - MESSAGE_HEADER.size)
                self.found.messages.append(Found(self.topics[channel], received_ns, read))


def _records(content: Buffer, start: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, and where the content lies, of the records from `start` on; the last may reach beyond the end."""
    while start + RECORD_HEADER.size <= len(content):
        kind, size = RECORD_HEADER.unpack_from(content, start)
        start += RECORD_HEADER.size
        yield kind, start, size
        start += size


def _text(content: Buffer, start: int) -> str:
    (size,) = struct.unpack_from("<I", content, start)
    return content[start + 4 : start + 4 + size].decode()
