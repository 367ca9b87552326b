"""The engine of one machine: reading, segmenting and writing overlap, each in threads of its own.

As many threads segment as there are cores, each a window on one core, which labels more frames a second than all
cores on one frame; the core of the package works without Python's lock meanwhile. Reading and writing wait for the
disk most of the time and take little of a core. Queues are short, so that memory does not grow with the frames.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from queue import Empty, Queue

from ldls.batch.frame_work import FrameWork
from ldls.batch.window import Frames, Outcome, Window

READERS = 2
WRITERS = 2
SWITCH_INTERVAL_S = 0.0005
"""Seconds for which a thread keeps Python's lock when others want it: the default, 5 ms, is a third of a frame."""
POLL_S = 0.1
"""Seconds between looks of waiting threads at the flag that stops the run."""


def run_local(work: FrameWork, windows: Sequence[Frames], workers: int) -> Iterator[Outcome]:
    """Yield the outcome of each of `windows`, in the order in which they are finished.

    Args:
        work: What is done with a window.
        windows: Number and name of each frame of each.
        workers: Windows that are segmented at a time.
    """
    pipeline = _Pipeline(workers)
    with _eager_switching():
        try:
            pipeline.start(
                [(work.read, READERS), (work.segment, workers), (work.write, WRITERS)],
                map(Window.of, windows),
            )
            for _ in windows:
                yield pipeline.next_outcome()
        finally:
            pipeline.stop()


class _Pipeline:
    """Stages that hand windows on to one another."""

    def __init__(self, workers: int) -> None:
        self._stopped = threading.Event()
        self._outcomes: Queue[Outcome | BaseException] = Queue()
        # windows between reading and the end: enough that nobody waits, few enough to bound the memory
        self._room = threading.Semaphore(2 * workers + READERS + WRITERS)
        self._threads: list[threading.Thread] = []

    def start(self, stages: Sequence[tuple[Callable[[Window], None], int]], windows: Iterator[Window]) -> None:
        queues: list[Queue[Window]] = [Queue() for _ in stages]
        outlets: list[Callable[[Window], None]] = [queue.put for queue in queues[1:]]
        outlets.append(lambda window: self._outcomes.put(window.outcome()))
        self._spawn(self._feed, windows, queues[0])
        for (stage, count), inbox, outlet in zip(stages, queues, outlets, strict=True):
            for _ in range(count):
                self._spawn(self._do, stage, inbox, outlet)

    def next_outcome(self) -> Outcome:
        outcome = self._outcomes.get()
        if isinstance(outcome, BaseException):
            raise outcome
        self._room.release()
        return outcome

    def stop(self) -> None:
        self._stopped.set()
        for thread in self._threads:
            thread.join()

    def _spawn(self, target: Callable[..., None], *arguments: object) -> None:
        thread = threading.Thread(target=self._guarded, args=(target, *arguments), daemon=True)
        self._threads.append(thread)
        thread.start()

    def _guarded(self, target: Callable[..., None], *arguments: object) -> None:
        try:
            target(*arguments)
        except BaseException as error:  # whatever it is, whoever waits for outcomes must hear of it
            self._outcomes.put(error)

    def _feed(self, windows: Iterator[Window], first: Queue[Window]) -> None:
        for window in windows:
            while not self._room.acquire(timeout=POLL_S):
                if self._stopped.is_set():
                    return
            first.put(window)

    def _do(self, stage: Callable[[Window], None], inbox: Queue[Window], outlet: Callable[[Window], None]) -> None:
        while not self._stopped.is_set():
            try:
                window = inbox.get(timeout=POLL_S)
            except Empty:
                continue
            stage(window)
            outlet(window)


@contextmanager
def _eager_switching() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before)
