"""A worker of a Ray cluster: a process, on some machine, that does windows of frames.

A worker notes each outcome in a file of its own in the folder of the run before it hands it back. If its machine is
cut off meanwhile, whoever gave it the window finds the outcome there, and it is not done again.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from pathlib import Path

import ldls._ldls as _ldls
from ldls.batch.frame_work import FrameWork
from ldls.batch.lock import HOLDER_NAME
from ldls.batch.window import Frames, Outcome, Window
from ldls.errors import BatchError

WAIT_S = 60.0
"""Network file systems show new files with a delay."""


class RayWorker:
    """Does windows one after the other, or some at a time where it has several cores beside its GPU."""

    def open(self, work: FrameWork, version: str, holder: str, notes: str, wait_s: float = WAIT_S) -> None:
        """Prepare for windows.

        Args:
            work: What is done with a window; it was opened anew on its way here.
            version: Version of ldls of the run.
            holder: What the run says of itself in its folder.
            notes: Name of the file of notes of this worker, which is there until the worker is given up.
            wait_s: How long to wait for that to be seen here.

        Raises:
            BatchError: This machine has another version, or does not see the folder.
        """
        if version != _ldls.__version__:
            raise BatchError(f"a worker has ldls {_ldls.__version__}, the run is of {version}; install one everywhere")
        if not _sees(work.out, holder, wait_s):
            raise BatchError(
                f"{work.out}: a worker does not see the folder of the run; it must be on storage that all machines "
                "share, under the same path"
            )
        self._work, self._notes = work, work.out / notes

    def do(self, frames: Frames) -> Outcome:
        """Segment the frames of a window; return its outcome.

        Raises:
            BatchError: This worker was given up, and the window is done by another.
        """
        window = Window.of(frames)
        self._work.read(window)
        self._work.segment(window)
        if not self._notes.exists():
            raise BatchError(f"{self._notes}: is gone, so that this worker is no longer wanted")
        self._work.write(window)
        outcome = window.outcome()
        line = json.dumps({"records": outcome.records, "seconds": outcome.seconds}) + "\n"
        # without its notes it was given up; on a full disk the outcome still goes its usual way
        with contextlib.suppress(OSError), os.fdopen(os.open(self._notes, os.O_WRONLY | os.O_APPEND), "ab") as file:
            # closed at once, for only then network file systems show it to others
            file.write(line.encode())
        return outcome


def _sees(folder: Path, holder: str, wait_s: float) -> bool:
    patience = time.monotonic() + wait_s
    while True:
        try:
            if (folder / HOLDER_NAME).read_text(encoding="utf-8") == holder:
                return True
        except OSError:
            pass
        if time.monotonic() > patience:
            return False
        time.sleep(min(0.5, wait_s))
