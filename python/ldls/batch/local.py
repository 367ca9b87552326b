"""The engine of one machine: reading, segmenting and writing overlap, each in threads of its own.

As many threads segment as there are cores, each a window on one core, which labels more frames a second than all
cores on one frame; the core of the package works without Python's lock meanwhile. Reading and writing wait for the
disk most of the time and take little of a core. Queues are short, so that memory does not grow with the frames.

Threads wait for one another at a `SimpleQueue` alone, and for as long as it takes. It is written in C, so Ctrl-C cannot
come after a lock is taken and before it is sure to be let go of, as in conditions and all that is made of them; with a
timeout and several that wait, Python 3.11 may wait for ever.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from queue import SimpleQueue
from typing import Any, TypeVar

from ldls.batch.frame_work import FrameWork
from ldls.batch.window import Frames, Outcome, Window

N_READERS = 2
N_WRITERS = 2
SWITCH_INTERVAL_S = 0.0005
"""Seconds for which a thread keeps Python's lock when others want it: the default, 5 ms, is a third of a frame."""
Item = TypeVar("Item")


def run_local(work: FrameWork, windows: Sequence[Frames], workers: int) -> Generator[Outcome]:
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
                [(work.read, N_READERS), (work.segment, workers), (work.write, N_WRITERS)],
                map(Window.of, windows),
            )
            for _ in windows:
                yield pipeline.next_outcome()
        finally:
            pipeline.stop()


class _Pipeline:
    """Stages that hand windows on to one another."""

    def __init__(self, workers: int) -> None:
        self._stopped = False
        self._outcomes: SimpleQueue[Outcome | BaseException] = SimpleQueue()
        # for windows between reading and the end: enough that nobody waits, few enough to bound the memory
        self._places: SimpleQueue[None] = SimpleQueue()
        for _ in range(2 * workers + N_READERS + N_WRITERS):
            self._places.put(None)
        self._threads: list[tuple[threading.Thread, SimpleQueue[Any]]] = []

    def start(self, stages: Sequence[tuple[Callable[[Window], None], int]], windows: Iterator[Window]) -> None:
        queues: list[SimpleQueue[Window]] = [SimpleQueue() for _ in stages]
        outlets: list[Callable[[Window], None]] = [queue.put for queue in queues[1:]]
        outlets.append(lambda window: self._outcomes.put(window.outcome()))
        self._spawn(self._feed, self._places, windows, queues[0])
        for (stage, count), inbox, outlet in zip(stages, queues, outlets, strict=True):
            for _ in range(count):
                self._spawn(self._do, inbox, stage, outlet)

    def next_outcome(self) -> Outcome:
        outcome = self._outcomes.get()
        if isinstance(outcome, BaseException):
            raise outcome
        self._places.put(None)
        return outcome

    def stop(self) -> None:
        self._stopped = True
        for _, inbox in self._threads:
            inbox.put(None)  # wakes one of those that wait
        for thread, _ in self._threads:
            thread.join()

    def _spawn(self, target: Callable[..., None], inbox: SimpleQueue[Any], *arguments: object) -> None:
        thread = threading.Thread(target=self._guarded, args=(target, inbox, *arguments), daemon=True)
        thread.start()
        self._threads.append((thread, inbox))

    def _guarded(self, target: Callable[..., None], *arguments: object) -> None:
        try:
            target(*arguments)
        except BaseException as error:  # whatever it is, whoever waits for outcomes must hear of it
            self._outcomes.put(error)

    def _feed(self, places: SimpleQueue[None], windows: Iterator[Window], first: SimpleQueue[Window]) -> None:
        for _, window in zip(self._out_of(places), windows, strict=False):
            first.put(window)

    def _do(
        self, inbox: SimpleQueue[Window], stage: Callable[[Window], None], outlet: Callable[[Window], None]
    ) -> None:
        for window in self._out_of(inbox):
            stage(window)
            outlet(window)

    def _out_of(self, queue: SimpleQueue[Item]) -> Iterator[Item]:
        """What is put into a queue, until the run is stopped."""
        while True:
            item = queue.get()
            if self._stopped:
                return
            yield item


@contextmanager
def _eager_switching() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        yield
    finally:
        sys.setswitchinterval(before)
