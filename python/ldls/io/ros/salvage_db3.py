"""Whole messages of a ROS 2 SQLite file, read row by row as long as the rows hold."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from functools import partial
from pathlib import Path

from ldls.io.ros.salvage import Found, Salvage

MAGIC = b"SQLite format 3\0"


def scan(path: Path, found: Salvage) -> str | None:
    """Add the whole messages of a file to `found`; how it ends if damaged, None if every row can be read."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return f"does not begin with {MAGIC!r}, so it is no SQLite file"
    with closing(_connect(path)) as connection:
        try:
            rows = connection.execute("SELECT id, name, type FROM topics")
            topics = {number: (name, kind) for number, name, kind in rows}
            found.types.update(dict(topics.values()))
            # the data are read so that a message cut short counts as damaged
            rows = connection.execute("SELECT id, topic_id, timestamp, data FROM messages ORDER BY id")
            for number, topic, received_ns, _ in rows:
                if topic in topics:
                    found.messages.append(Found(topics[topic][0], received_ns, partial(_read, path, number)))
        except sqlite3.DatabaseError as error:
            return f"SQLite finds it damaged ({error})"
    return None


def _connect(path: Path) -> sqlite3.Connection:
    """The file, opened for reading although it may be shorter than its header says."""
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)
    connection.execute("PRAGMA writable_schema = ON")
    return connection


def _read(path: Path, number: int) -> bytes:
    with closing(_connect(path)) as connection:
        (raw,) = connection.execute("SELECT data FROM messages WHERE id = ?", (number,)).fetchone()
    return bytes(raw)
