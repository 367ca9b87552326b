"""One run at a time in a folder."""

from __future__ import annotations

import contextlib
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from ldls.errors import BatchError
from ldls.io.files import open_file, refuse_link, whole_file

LOCK_NAME = ".ldls-lock"
HOLDER_NAME = ".ldls-holder"
"""Tells who holds the lock; a file of its own, as some systems let nobody read one that is locked."""


@contextmanager
def only_run(folder: Path) -> Iterator[None]:
    """Hold `folder` for this process; the system lets go of it however the process ends.

    Raises:
        BatchError: Another run, which still lives, holds it.
        UnsafePathError: The lock is a link.
    """
    path, holder = folder / LOCK_NAME, folder / HOLDER_NAME
    refuse_link(path)
    lock = FileLock(path)
    try:
        lock.acquire(blocking=False)
    except Timeout:
        raise BatchError(
            f"{folder}: another run is at work here ({_holder(holder)}); wait for it, or choose another folder"
        ) from None
    try:
        with whole_file(holder) as file:
            file.write(json.dumps({"pid": os.getpid(), "host": socket.gethostname()}).encode())
        yield
    finally:
        holder.unlink(missing_ok=True)
        # while it is held, for then it is ours; Windows removes no open files
        with contextlib.suppress(PermissionError):
            path.unlink(missing_ok=True)
        lock.release()


def _holder(path: Path) -> str:
    try:
        with open_file(path, "note of a run") as file:
            holder = json.loads(file.text())
        return f"process {holder['pid']} on {holder['host']}"
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return "process unknown"
