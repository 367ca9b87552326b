"""Whole messages of a ROS 2 SQLite file, read row by row as long as the rows hold."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, Self

from ldls._optional import require
from ldls.errors import TruncatedFileError
from ldls.io.ros.salvage import Found, Salvage

MAGIC = b"SQLite format 3\0"
HEADER_BYTES = 100


@dataclass(frozen=True)
class _Extent:
    """What a file says of its size (https://sqlite.org/fileformat2.html#the_database_header), and what it has.

    Attributes:
        page: Bytes a page.
        expected: Bytes that the file should have; 0 if its last writer did not keep count.
        found: Bytes that it has.
    """

    page: int
    expected: int
    found: int

    @classmethod
    def of(cls, path: Path) -> Self | None:
        """The extent of a file; None if it is no SQLite file."""
        with path.open("rb") as file:
            header = file.read(HEADER_BYTES)
        if len(header) < HEADER_BYTES or not header.startswith(MAGIC):
            return None
        page, changes, pages, valid_for = (
            int.from_bytes(header[start:end]) for start, end in ((16, 18), (24, 28), (28, 32), (92, 96))
        )
        page = 65536 if page == 1 else page
        return cls(page, pages * page if changes == valid_for else 0, path.stat().st_size)


def check_size(path: Path) -> None:
    """Refuse a file that is shorter than its header says; SQLite finds out only at the pages that are missing.

    Raises:
        TruncatedFileError: It is shorter.
    """
    extent = _Extent.of(path)
    if extent is not None and extent.found < extent.expected:
        raise TruncatedFileError(f"{path}: ends at byte {extent.found}, expected {extent.expected}")


def scan(path: Path, found: Salvage) -> str | None:
    """Add the whole messages of a file to `found`; how it ends if damaged, None if every row can be read."""
    extent = _Extent.of(path)
    if extent is None:
        return f"does not begin with {MAGIC!r}, so it is no SQLite file"
    try:
        with closing(_connect(path, extent.page)) as connection:
            topics = {
                number: (name, kind) for number, name, kind in connection.execute("SELECT id, name, type FROM topics")
            }
            found.types.update(dict(topics.values()))
            # the data are read so that a message cut short counts as damaged
            for number, topic, received_ns, _ in connection.execute(
                "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id"
            ):
                if topic in topics:
                    read = partial(_read, path, extent.page, number)
                    found.messages.append(Found(topics[topic][0], received_ns, read))
    except require("apsw", "ros").Error as error:
        return f"SQLite finds it damaged ({error})"
    return None


def _read(path: Path, page: int, number: int) -> bytes:
    with closing(_connect(path, page)) as connection:
        ((raw,),) = connection.execute("SELECT data FROM messages WHERE id = ?", (number,))
    return bytes(raw)


def _connect(path: Path, page: int) -> Any:  # noqa: ANN401
    """The file, opened for reading although it may be shorter than its header says."""
    apsw = require("apsw", "ros")
    flags = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
    connection = apsw.Connection(f"{path.resolve().as_uri()}?immutable=1", flags=flags, vfs=_whole_pages(page).vfs_name)
    connection.execute("PRAGMA writable_schema = ON")
    return connection


@cache
def _whole_pages(page: int) -> Any:  # noqa: ANN401
    """Files without their last page where it is cut: SQLite would take what is missing for zeros."""
    apsw = require("apsw", "ros")

    class File(apsw.VFSFile):  # type: ignore[misc, name-defined]
        def __init__(self, name: str, flags: list[int]) -> None:
            super().__init__("", name, flags)

        def xFileSize(self) -> int:
            size: int = super().xFileSize()
            return size - size % page

    class Files(apsw.VFS):  # type: ignore[misc, name-defined]
        vfs_name = f"ldls-whole-pages-{page}"

        def __init__(self) -> None:
            super().__init__(self.vfs_name, "")

        def xOpen(self, name: str, flags: list[int]) -> File:
            return File(name, flags)

    return Files()
