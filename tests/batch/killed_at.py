"""Runs `ldls` and kills it at the n-th time that it comes to a step: killed_at.py STEP N run SOURCE ...

With `work` for a step, it is killed when its threads have computed for N seconds since it took hold of the folder.
"""

import os
import signal
import sys
import time
from itertools import count
from pathlib import Path
from types import SimpleNamespace

from ldls.batch import journal
from ldls.batch.lock import LOCK_NAME
from ldls.cli import app
from ldls.io import files

FSYNC, REPLACE, UNLINK = os.fsync, Path.replace, Path.unlink
WRITE_LINES = journal.Journal._append


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def before(function, wanted=lambda *_, **__: True):
    """`function`, death before its n-th call whose arguments are `wanted`."""

    def wrapped(*arguments, **options):
        if wanted(*arguments, **options) and next(COUNT) == N:
            die()
        return function(*arguments, **options)

    return wrapped


def after(function):
    def wrapped(*arguments, **options):
        result = function(*arguments, **options)
        if next(COUNT) == N:
            die()
        return result

    return wrapped


def half_a_line(self, records):
    if next(COUNT) == N:
        self._file.write(journal.line_of(next(iter(records)))[:40])
        die()
    return WRITE_LINES(self, records)


def replaces_journal(_, target):
    return Path(target).name == journal.JOURNAL_NAME


def is_lock(path, **_):
    return path.name == LOCK_NAME


STEPS = {
    "file written, not synced": lambda: setattr(files.os, "fsync", before(FSYNC)),
    "file synced, not renamed": lambda: setattr(Path, "replace", before(REPLACE)),
    "file renamed": lambda: setattr(Path, "replace", after(REPLACE)),
    "folder not synced": lambda: setattr(journal, "sync_folder", before(journal.sync_folder)),
    "line half written": lambda: setattr(journal.Journal, "_append", half_a_line),
    "line written": lambda: setattr(journal.Journal, "_append", after(WRITE_LINES)),
    "journal not put in order": lambda: setattr(journal.Journal, "finish", before(journal.Journal.finish)),
    "journal in order, not renamed": lambda: setattr(Path, "replace", before(REPLACE, replaces_journal)),
    "journal renamed, lock not let go": lambda: setattr(Path, "unlink", before(UNLINK, is_lock)),
}  # fmt: skip

WORK = "work"


def kill_after_work(seconds):
    """Let the run end at a moment that hangs on nothing but its own work; SIGPROF ends it as SIGKILL does."""
    open_journal = journal.Journal.__init__

    def opened(*arguments):
        signal.setitimer(signal.ITIMER_PROF, seconds)
        open_journal(*arguments)

    journal.Journal.__init__ = opened


def every_sixth_frame_ends_a_group():
    """Let lines reach the journal in groups of six, on fast machines and on slow ones."""
    ticks = count()
    # the function of that name hides the module
    run = sys.modules["ldls.batch.run"]
    run.time = SimpleNamespace(monotonic=lambda: next(ticks) * run.GROUP_S / 5.5, perf_counter=time.perf_counter)


if __name__ == "__main__":
    every_sixth_frame_ends_a_group()
    if sys.argv[1] == WORK:
        kill_after_work(float(sys.argv[2]))
    else:
        COUNT, N = count(1), int(sys.argv[2])
        STEPS[sys.argv[1]]()
    app(sys.argv[3:])
