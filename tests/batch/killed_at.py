"""Runs `ldls` and kills it at the n-th time that it comes to a step: killed_at.py STEP N run SOURCE ..."""

import os
import signal
import sys
from itertools import count
from pathlib import Path

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
        self._file.write(journal._line(next(iter(records)))[:40])
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

if __name__ == "__main__":
    COUNT, N = count(1), int(sys.argv[2])
    STEPS[sys.argv[1]]()
    app(sys.argv[3:])
