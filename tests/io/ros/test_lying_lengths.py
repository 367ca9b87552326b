"""Bags in which a length is not that of its record: no memory is asked for, and the whole messages come out."""

import os
import sqlite3
import struct
import warnings
from collections import Counter
from contextlib import closing

import pytest

pytest.importorskip("rosbags")

from datasets.ros_samples import Recording, messages, storage
from ldls.errors import CorruptFileError, FileFormatError, RecoveredFileWarning, TruncatedFileError
from ldls.io.ros.bags import open_bag

SUFFIXES = {"rosbag1": ".bag", "rosbag2": ".db3", "mcap": ".mcap"}


@pytest.fixture
def bag(tmp_path, request):
    """A small bag of a kind: the path of its one file, its bytes, and its messages."""
    kind = request.param
    whole = storage(Recording(kind=kind, sweeps=1, size=(6, 8)).write(tmp_path / "whole"))
    path = tmp_path / f"a{SUFFIXES[kind]}"
    path.write_bytes(whole.read_bytes())
    return path, path.read_bytes(), messages(path)


def mcap_lengths(content, start=8, end=None):
    """Where the length of each record stands, those in chunks too."""
    end = len(content) - 8 if end is None else end
    while start < end:
        kind, size = struct.unpack_from("<BQ", content, start)
        yield start + 1
        if kind == 6:
            records = start + 9 + 28 + 4 + struct.unpack_from("<I", content, start + 37)[0] + 8
            yield from mcap_lengths(content, records, start + 9 + size)
        start += 9 + size


def bag_lengths(content, start=13, end=None):
    """Where the two lengths of each record stand, those in chunks too."""
    end = len(content) if end is None else end
    while start < end:
        (header,) = struct.unpack_from("<I", content, start)
        (size,) = struct.unpack_from("<I", content, start + 4 + header)
        yield from (start, start + 4 + header)
        if b"op=\x05" in content[start : start + header]:
            yield from bag_lengths(content, start + 8 + header, start + 8 + header + size)
        start += 8 + header + size


def check(path, content, recorded):
    """A changed bag gives what was recorded or is refused; then its whole messages are those that were recorded."""
    path.write_bytes(content)
    try:
        assert messages(path) == recorded
    except (TruncatedFileError, CorruptFileError) as error:
        assert str(error).startswith(f"{path}: ")
    else:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecoveredFileWarning)
        try:
            saved = messages(path, recover=True)
        except FileFormatError:  # there is none
            saved = []
    assert not Counter(saved) - Counter(recorded)
    return len(saved)


@pytest.mark.parametrize("lie", [2**33, 2**64 - 1])
@pytest.mark.parametrize("bag", ["mcap"], indirect=True)
def test_an_mcap_file_with_a_length_that_lies_keeps_the_messages_before_it(bag, lie):
    path, content, recorded = bag
    ends = [content.find(raw) + len(raw) for _, _, raw in recorded]
    for at in mcap_lengths(content):
        saved = check(path, content[:at] + struct.pack("<Q", lie) + content[at + 8 :], recorded)
        assert saved is None or saved >= sum(end <= at for end in ends)


@pytest.mark.parametrize("bag", ["rosbag1"], indirect=True)
def test_a_ros_1_bag_with_a_length_that_lies_keeps_the_messages_before_it(bag):
    path, content, recorded = bag
    ends = [content.find(raw) + len(raw) for _, _, raw in recorded]
    for at in bag_lengths(content):
        saved = check(path, content[:at] + b"\xff" * 4 + content[at + 4 :], recorded)
        assert saved is None or saved >= sum(end <= at for end in ends)


@pytest.mark.parametrize("bag", ["rosbag2"], indirect=True)
def test_a_database_with_pages_that_lie_gives_what_was_recorded_or_is_refused(bag):
    path, content, recorded = bag
    places = (16, 20, 24, 28, 100, *range(4096, len(content), 4096))  # of the file's header, and the start of each page
    saved = [check(path, content[:at] + b"\xff" * 4 + content[at + 4 :], recorded) for at in places]
    assert None in saved and len(recorded) in saved


@pytest.mark.parametrize("bag", ["rosbag2"], indirect=True)
def test_a_database_without_a_page_size_is_refused(bag):
    path, content, _ = bag
    path.write_bytes(content[:16] + bytes(2) + content[18:])
    message = "a.db3: .*not a database.*; 0 whole messages"
    with pytest.raises(TruncatedFileError, match=message):
        messages(path)
    with pytest.warns(RecoveredFileWarning, match=message):
        assert messages(path, recover=True) == []


@pytest.mark.parametrize("bag", ["rosbag1", "rosbag2", "mcap"], indirect=True)
def test_a_whole_bag_is_the_same_where_recovery_is_asked_for(bag):
    path, _, recorded = bag
    assert messages(path, recover=True) == recorded


@pytest.mark.parametrize("bag", ["rosbag1", "rosbag2", "mcap"], indirect=True)
def test_a_bag_that_shrinks_while_it_is_read_is_refused(bag):
    path, content, _ = bag
    opened = open_bag(path)
    os.truncate(path, len(content) // 4)
    with pytest.raises(FileFormatError, match=path.name):
        list(opened.messages(opened.topics))
    opened.close()


@pytest.mark.parametrize("bag", ["rosbag1", "mcap"], indirect=True)
def test_a_recovered_bag_that_shrinks_while_it_is_read_is_refused(bag):
    path, content, recorded = bag
    path.write_bytes(content[:-1])
    with pytest.warns(RecoveredFileWarning, match=f"{len(recorded)} whole messages"):
        opened = open_bag(path, recover=True)
    os.truncate(path, 100)
    with pytest.raises(TruncatedFileError, match=f"{path.name}: ends within a message"):
        list(opened.messages(opened.topics))


@pytest.mark.parametrize("suffix", SUFFIXES.values())
def test_what_is_no_regular_file_is_no_bag(tmp_path, suffix):
    os.mkfifo(tmp_path / f"pipe{suffix}")
    (tmp_path / f"zeros{suffix}").symlink_to("/dev/zero")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "folder" / f"a{suffix}")
    (tmp_path / "described").mkdir()
    os.mkfifo(tmp_path / "described" / "metadata.yaml")
    for name in (f"pipe{suffix}", f"zeros{suffix}", "folder", "described"):
        with pytest.raises(FileFormatError, match=f"{name}.*: expected a regular file, got a"):
            open_bag(tmp_path / name)


@pytest.mark.parametrize("bag", ["rosbag2"], indirect=True)
def test_a_database_with_a_topic_without_a_name_is_refused(bag):
    path, _, recorded = bag
    with closing(sqlite3.connect(path)) as database, database:
        columns = [row[1] for row in database.execute("PRAGMA table_info(topics)")]
        names = ", ".join("NULL" if name == "name" else name for name in columns)
        database.execute("CREATE TABLE copy AS SELECT * FROM topics")
        database.execute("DROP TABLE topics")
        database.execute(f"CREATE TABLE topics ({', '.join(columns)})")
        database.execute(f"INSERT INTO topics SELECT {names} FROM copy WHERE id = 1")
        database.execute("INSERT INTO topics SELECT * FROM copy WHERE id > 1")
    with pytest.raises(TruncatedFileError, match=f"a.db3: .*; {len(recorded) - 1} whole messages"):
        messages(path)
    with pytest.warns(RecoveredFileWarning):
        assert len(messages(path, recover=True)) == len(recorded) - 1


@pytest.mark.parametrize("bag", ["rosbag2"], indirect=True)
def test_a_message_that_is_a_number_asks_for_no_memory(bag):
    path, _, recorded = bag
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE messages SET data = 1 << 40 WHERE id = 2")
    with pytest.raises(CorruptFileError, match="a.db3: .*not 'int'"):
        messages(path)
    with pytest.warns(RecoveredFileWarning):
        assert len(messages(path, recover=True)) == len(recorded) - 1
