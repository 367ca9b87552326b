"""Peak of memory of one call, in a process of its own: `python -m benches.memory N`."""

from __future__ import annotations

import resource
import subprocess
import sys
import threading
import time
from pathlib import Path

import ldls
from benches.frames import frame, tiled_frame

PAGE_BYTES = resource.getpagesize()


def extra_bytes(n: int) -> int:
    """Bytes that segmenting `n` tiled points takes at its peak beyond what the cloud itself takes."""
    outcome = subprocess.run(
        [sys.executable, "-m", "benches.memory", str(n)], check=True, capture_output=True, text=True
    )
    return int(outcome.stdout)


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_BYTES


def _measure(n: int) -> int:
    tiled = tiled_frame(frame().in_view(), n)
    before = peak = _resident_bytes()
    done = threading.Event()

    def watch() -> None:
        nonlocal peak
        while not done.is_set():
            peak = max(peak, _resident_bytes())
            time.sleep(0.0005)

    watcher = threading.Thread(target=watch)
    watcher.start()
    result = ldls.segment(tiled.points, tiled.masks, tiled.camera)
    done.set()
    watcher.join()
    assert len(result.labels) == n
    return peak - before


if __name__ == "__main__":
    print(_measure(int(sys.argv[1])))
