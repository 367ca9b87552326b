"""A worker of a Ray cluster: a process, on some machine, that does frames."""

from __future__ import annotations

import time
from pathlib import Path

import ldls._ldls as _ldls
from ldls.batch.frame_work import FrameWork, Outcome, Work
from ldls.batch.lock import HOLDER_NAME
from ldls.errors import BatchError

WAIT_S = 60.0
"""Network file systems show new files with a delay."""


class RayWorker:
    """Does frames one after the other, or some at a time where it has several cores beside its GPU."""

    def open(self, work: FrameWork, version: str, holder: str, wait_s: float = WAIT_S) -> None:
        """Prepare for frames.

        Args:
            work: What is done with a frame; it was opened anew on its way here.
            version: Version of ldls of the run.
            holder: What the run says of itself in its folder.
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
        self._work = work

    def do(self, index: int, name: str) -> Outcome:
        """Segment a frame; return its outcome."""
        return self._work.do(Work(index, name))


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
