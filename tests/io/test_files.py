"""The one door through which files come: what it refuses, and what it makes of failures of whatever parses them."""

import errno
import os
import re
import socket
import struct
import subprocess
import sys
import tokenize
from pathlib import Path

import numpy as np
import pytest

import ldls
from ldls.io.files import UNFINISHED, open_file, remove_unfinished, sync_folder, whole_file


class PanicException(BaseException):
    """As libraries in Rust raise it: `except Exception` does not catch it."""


@pytest.fixture
def path(tmp_path):
    """A file of ten bytes."""
    path = tmp_path / "ten.bin"
    path.write_bytes(b"0123456789")
    return path


def failing(path, error):
    with open_file(path, "image"):
        raise error


@pytest.mark.parametrize(
    "error",
    [
        pytest.param(PanicException("index out of bounds"), id="panic of a library in Rust"),
        pytest.param(RecursionError("too deep"), id="nesting"),
        pytest.param(struct.error("unpack requires 4 bytes"), id="struct"),
        pytest.param(tokenize.TokenError("EOF in multi-line statement"), id="numpy header"),
        pytest.param(KeyError("TYPE"), id="missing key"),
        pytest.param(IndexError("list index out of range"), id="index"),
        pytest.param(ZeroDivisionError("division by zero"), id="division by zero"),
        pytest.param(AttributeError("no attribute"), id="attribute"),
        pytest.param(SystemError("unknown opcode"), id="system error"),
        pytest.param(OverflowError("too large"), id="overflow"),
        pytest.param(AssertionError("chunk"), id="assertion"),
        pytest.param(StopIteration(), id="end of an iterator"),
        pytest.param(np._core._exceptions._UFuncNoLoopError(np.add, (np.dtype("U1"),) * 3), id="UFuncTypeError"),
        pytest.param(OSError("image file is truncated"), id="OSError of a library"),
        pytest.param(OSError(errno.EINVAL, "Invalid argument"), id="seek to a place before the file"),
    ],
)
def test_whatever_a_library_raises_is_a_corrupt_file(path, error):
    with pytest.raises(ldls.CorruptFileError, match=r"ten\.bin: not a whole image \(") as caught:
        failing(path, error)
    assert type(error).__name__ in str(caught.value)


@pytest.mark.parametrize(
    "error",
    [
        pytest.param(OSError(errno.EIO, "Input/output error"), id="disk"),
        pytest.param(MemoryError(), id="memory"),
        pytest.param(KeyboardInterrupt(), id="Ctrl-C"),
        pytest.param(SystemExit(2), id="exit"),
        pytest.param(ImportError("run: pip install 'ldls[ros]'"), id="missing extra"),
        pytest.param(UserWarning("made an error by the user's filter"), id="warning"),
    ],
)
def test_what_is_not_the_files_fault_passes(path, error):
    with pytest.raises(type(error)) as caught:
        failing(path, error)
    assert caught.value is error


def test_errors_of_the_system_name_the_file(path):
    with pytest.raises(OSError, match=r"ten\.bin"):
        failing(path, OSError(errno.EIO, "Input/output error"))


@pytest.mark.parametrize("place", ["", "{path}: ", "{path}, line 3: "], ids=["bare", "named", "line named"])
def test_errors_of_ldls_name_the_file_once(path, place):
    with pytest.raises(ldls.MaskError) as caught, open_file(path, "file of masks"):
        failing(path, ldls.MaskError(place.format(path=path) + "no such mask"))
    assert str(caught.value) == (place or "{path}: ").format(path=path) + "no such mask"


def test_more_than_the_limit_is_refused_with_size_and_limit(path):
    with open_file(path, "calibration", limit=10) as file:
        assert file.read() == b"0123456789"
    with (
        pytest.raises(ldls.LimitError, match=r"ten\.bin: 10 bytes, expected at most 9 of a calibration"),
        open_file(path, "calibration", limit=9),
    ):
        pass


def test_a_file_that_grows_ends_where_it_ended(path):
    with open_file(path, "file") as file, path.open("ab") as writer:
        writer.write(b"more" * 1000)
        writer.flush()
        assert file.read() == b"0123456789"
        assert file.read() == b""


def test_a_file_that_shrinks_while_it_is_read_is_truncated(path):
    message = rf"{path.name}: ends at byte 4, it had 10 when it was opened"
    with pytest.raises(ldls.TruncatedFileError, match=message), open_file(path, "file") as file:
        os.truncate(path, 4)
        file.read()


def test_lying_lengths_take_no_memory(path):
    with open_file(path, "file") as file:
        assert file.read(1 << 60) == b"0123456789"


def test_a_socket_is_refused(tmp_path):
    path = tmp_path / "socket"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        with (
            pytest.raises(ldls.FileFormatError, match="got a socket"),
            open_file(path, "file"),
        ):
            pass


def test_paths_with_nul_are_refused():
    with pytest.raises(ldls.UnsafePathError, match="null"), open_file("a\0b", "file"):
        pass


def test_a_missing_file_stays_one(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"missing\.bin"), open_file(tmp_path / "missing.bin", "file"):
        pass


@pytest.mark.parametrize("length", [254, 255])
def test_names_as_long_as_names_can_be_are_written(tmp_path, length):
    path = tmp_path / ("n" * (length - 4) + ".bin")
    with whole_file(path) as file:
        file.write(b"content")
    assert path.read_bytes() == b"content"
    assert list(tmp_path.iterdir()) == [path]


def test_a_name_that_is_too_long_leaves_nothing(tmp_path):
    with pytest.raises(OSError, match="nnnn") as caught, whole_file(tmp_path / ("n" * 256)) as file:
        file.write(b"content")
    assert caught.value.errno == errno.ENAMETOOLONG
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def no_folder_opens(monkeypatch):
    """As on Windows, where opening a folder is not permitted."""

    def refuse(path, flags):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(os, "open", refuse)


def test_folders_are_synced_and_swept_where_none_can_be_opened(tmp_path, no_folder_opens):
    (tmp_path / f".0123{UNFINISHED}").write_bytes(b"")
    sync_folder(tmp_path)
    remove_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_folders_are_refused_where_none_can_be_opened(tmp_path, no_folder_opens):
    with pytest.raises(ldls.FileFormatError, match="got a folder"), open_file(tmp_path, "file"):
        pass


def test_flags_that_a_system_lacks_are_done_without(path):
    lines = [
        "import os, sys",
        "del os.O_NONBLOCK, os.O_NOCTTY",
        "from ldls.io.files import open_file",
        "with open_file(sys.argv[1], 'file') as file: assert file.read() == b'0123456789'",
    ]
    subprocess.run([sys.executable, "-c", "\n".join(lines), str(path)], check=True)


BY_OTHER_WAYS = re.compile(
    r"\.read_(bytes|text)\(|np\.(load|fromfile|memmap)\(|(?<![\w.])open\(|\.open\((\"r|encoding|\))|ZipFile\(|Image\.open\("
)
FROM_THE_DOOR = {"io/arrays.py", "io/images.py", "io/ros/bags.py", "io/ros/writer.py"}
"""Modules whose libraries open what the door has opened, or write."""


def test_no_reader_goes_by_another_way():
    package = Path(ldls.__file__).parent
    modules = {path.relative_to(package).as_posix(): path.read_text() for path in package.rglob("*.py")}
    # a run's journal and lock are its own files, which grow while they are read
    others = {name for name, text in modules.items() if BY_OTHER_WAYS.search(text) and not name.startswith("batch/")}
    assert others == FROM_THE_DOOR


def test_a_folder_to_write_to_that_is_not_there_is_named(tmp_path):
    with (
        pytest.raises(FileNotFoundError, match="no such folder to write to; make it first: .*nowhere'"),
        whole_file(tmp_path / "nowhere/a.json"),
    ):
        pass


def test_a_folder_in_the_place_of_a_file_is_refused_by_its_name(tmp_path):
    (tmp_path / "d.npz").mkdir()
    with pytest.raises(ldls.FileFormatError, match=r"d\.npz: expected a file to write to, got a folder"):
        ldls.save(ldls.InstanceMasks.from_array(np.ones((1, 2, 2), bool)), tmp_path / "d.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["d.npz"]
