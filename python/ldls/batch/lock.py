"""One run at a time in a folder."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from ldls.errors import BatchError
from ldls.io.files import names_file

LOCK_NAME = ".ldls-lock"


@contextmanager
def only_run(folder: Path) -> Iterator[None]:
    """Hold `folder` for this process; the system lets go of it however the process ends.

    Raises:
        BatchError: Another run, which still lives, holds it.
    """
    path = folder / LOCK_NAME
    file = _locked(path)
    try:
        holder = {"pid": os.getpid(), "host": socket.gethostname()}
        with names_file(path):
            # past Python's buffers: on a full disk nothing is left over for close to trip on
            os.ftruncate(file.fileno(), 0)
            os.write(file.fileno(), json.dumps(holder).encode())
        yield
    finally:
        path.unlink(missing_ok=True)
        file.close()


def _locked(path: Path) -> IO[str]:
    while True:
        file = path.open("a+", encoding="utf-8")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            holder = _holder(file.read())
            file.close()
            raise BatchError(
                f"{path.parent}: another run is at work here ({holder}); wait for it, or choose another folder"
            ) from None
        # whoever held it may have removed it meanwhile, and another may have made a new one
        if path.exists() and os.path.samestat(path.stat(), os.fstat(file.fileno())):
            return file
        file.close()


def _holder(text: str) -> str:
    try:
        holder = json.loads(text)
        return f"process {holder['pid']} on {holder['host']}"
    except (ValueError, KeyError, TypeError):
        return "process unknown"
