"""Runs of `ldls run` in processes of their own, to be killed."""

import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

from command import python
from ldls.batch import RunSettings
from ldls.batch.lock import LOCK_NAME

KILLED_AT = Path(__file__).with_name("killed_at.py")
PATIENCE_S = 300
SLOWLY = """
import time
from ldls.batch.frame_work import FrameWork
from ldls.cli import app

read = FrameWork.read
FrameWork.read = lambda work, frame: (time.sleep(0.1), read(work, frame))
app()
"""
"""A program that does what `ldls` does, at most ten frames a second a reader."""


def stored(source, **settings):
    """Settings of a run with the masks that lie in its source."""
    return RunSettings(masks=str(source / "masks"), **settings)


def arguments(source, out, *more):
    return ["run", source, "--masks", source / "masks", "--out", out, *more]


@contextmanager
def started(arguments, program=("-m", "ldls")):
    """A run that is at work, and no more when the block ends."""
    command = [sys.executable, *program, *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, preexec_fn=hears_ctrl_c, **pipes) as running:
        try:
            yield running
        finally:
            running.kill()


def hears_ctrl_c():
    """Undo what shells do to processes in the background: they are started deaf to Ctrl-C, and so are theirs."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def killed(step, n, arguments):
    """A run that was killed at the `n`th of these steps."""
    return python(KILLED_AT, step, n, *arguments)


def has_begun(running, out):
    """Wait until a run holds its folder; False if it ended before."""
    return _comes_to(running, lambda: (out / LOCK_NAME).exists())


def has_done_some(running, out):
    """Wait until a run's journal knows of frames; False if it ended before."""
    journal = out / "journal.jsonl"
    return _comes_to(running, lambda: journal.exists() and journal.read_bytes().count(b"\n") > 1)


def _comes_to(running, state):
    wait_for(lambda: running.poll() is not None or state())
    return running.poll() is None


def wait_for(state):
    """Wait until `state` holds, longer than any machine needs."""
    patience = time.monotonic() + PATIENCE_S
    while not state():
        assert time.monotonic() < patience
        time.sleep(0.001)


def killed_after(arguments, out, seconds):
    """Kill a run so long after it took hold of its folder; whether it was still at work."""
    (out / LOCK_NAME).unlink(missing_ok=True)
    with started(arguments) as running:
        if has_begun(running, out):
            time.sleep(seconds)
        at_work = running.poll() is None
        running.kill()
    return at_work


def contents(folder):
    """All files of a folder, hidden ones included."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def without_journal(folder):
    return {name: content for name, content in contents(folder).items() if name != "journal.jsonl"}


def records(folder):
    """The record of each frame in the journal."""
    _, *lines = (folder / "journal.jsonl").read_text().splitlines()
    return {record["frame"]: record for record in map(json.loads, lines)}


def times(folder):
    """When each file was written, the journal left out."""
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir() if path.name != "journal.jsonl"}
