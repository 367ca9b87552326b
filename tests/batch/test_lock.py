"""One run at a time in a folder, however the one before it ended, and on systems without POSIX."""

import os
import signal

import pytest

from batch import runs
from command import command, python
from ldls.batch.lock import HOLDER_NAME, LOCK_NAME, only_run
from ldls.errors import BatchError
from ldls.io.files import UNFINISHED

HOLD = """
import sys, time
from pathlib import Path
from ldls.batch.lock import only_run

with only_run(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""
WITHOUT_POSIX = """
import importlib, pkgutil, sys

for name in ("fcntl", "pwd", "grp", "resource", "termios", "posix_ipc"):
    sys.modules[name] = None
import ldls

for module in pkgutil.walk_packages(ldls.__path__, "ldls."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
"""


def held(folder):
    return runs.started([folder], program=["-c", HOLD])


def test_the_lock_of_a_killed_process_holds_nobody_up(tmp_path):
    with held(tmp_path) as holder:
        assert holder.stdout.readline() == "held\n"
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    assert {path.name for path in tmp_path.iterdir()} == {LOCK_NAME, HOLDER_NAME}
    with only_run(tmp_path):
        assert f'"pid": {os.getpid()}' in (tmp_path / HOLDER_NAME).read_text()
    assert not list(tmp_path.iterdir())


def test_a_second_run_leaves_the_parts_of_a_living_one(few, tmp_path):
    part = tmp_path / f".000001.label.0123{UNFINISHED}"
    with held(tmp_path) as holder:
        assert holder.stdout.readline() == "held\n"
        part.write_bytes(b"half")
        outcome = command(*runs.arguments(few, tmp_path))
        assert f"process {holder.pid} on " in outcome.output
        assert part.exists()
    assert command(*runs.arguments(few, tmp_path)).exit_code == 0
    assert not part.exists()


@pytest.mark.parametrize("content", [b"", b"null", b"\xff", b"[" * 100_000, b'{"pid":1}'], ids=len)
def test_a_holder_that_tells_nothing_is_unknown(tmp_path, content):
    with held(tmp_path) as holder:
        assert holder.stdout.readline() == "held\n"
        (tmp_path / HOLDER_NAME).write_bytes(content)
        with pytest.raises(BatchError, match="process unknown"), only_run(tmp_path):
            pass


def test_no_module_needs_posix():
    outcome = python("-c", WITHOUT_POSIX)
    assert outcome.returncode == 0, outcome.stderr
