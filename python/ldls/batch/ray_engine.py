"""The engine of a Ray cluster: workers in processes of their own, each a window of frames on one core.

Windows go one by one to whoever is free. A worker that dies, or whose machine is cut off, is replaced, and its windows
are done elsewhere, save those whose outcome it could still note in the folder of the run. Machines that join the
cluster on the way get workers too. Outcomes come back to the process that began the run, which alone keeps the journal.
"""

from __future__ import annotations

import contextlib
import json
import logging
import pickle
import secrets
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import ldls._ldls as _ldls
from ldls._optional import require
from ldls.batch.frame_work import FrameWork
from ldls.batch.lock import HOLDER_NAME
from ldls.batch.ray_worker import RayWorker
from ldls.batch.window import Frames, Outcome
from ldls.errors import BatchError
from ldls.io.files import UNFINISHED

MAX_DEATHS = 3
"""Workers that one window may take along before its frames count as failed."""
MAX_STILLBIRTHS = 20
"""Workers that may die one after the other before any of them is ready."""
CONNECT_S = 10.0
LOOK_S = 5.0
"""Seconds between looks for machines that have joined the cluster."""
STARTING: Frames = ()
"""State of a worker that is starting."""


def run_ray(
    work: FrameWork,
    windows: Sequence[Frames],
    address: str | None,
    workers: int | None,
    gpus: float,
) -> Generator[Outcome]:
    """Yield the outcome of each of `windows`, in the order in which they are finished.

    Args:
        work: What is done with a window; workers open it anew.
        windows: Number and name of each frame of each.
        address: Address of a cluster, "auto" for the one that this machine is part of; None starts one on this machine.
        workers: Processes; one a core, or one for each share of a GPU, by default.
        gpus: GPUs of each worker. With any, the cores are shared out among the workers too, and each does as many
            windows at a time: one segmenter a GPU, and a core for each cloud.

    Raises:
        BatchError: Workers cannot be started, do not see the folder, or are of another version.
    """
    if not windows:
        return
    own_cores = _ldls.default_threads()
    with _joined(address, own_cores if gpus else workers or own_cores) as ray:
        resources = ray.cluster_resources()
        cores = max(int(resources.get("CPU", 1)), 1)
        if resources.get("GPU", 0) < gpus:
            raise BatchError(f"gpus: the cluster has {resources.get('GPU', 0):g}, a worker wants {gpus:g}")

        def wanted() -> int:
            """How many workers there is room for."""
            if workers is not None:
                return workers
            now = ray.cluster_resources()
            return int(now.get("GPU", 0) / gpus if gpus else now.get("CPU", 1))

        share = max(cores // max(wanted(), 1), 1) if gpus else 1
        pool = _Pool(ray, work, {"num_cpus": share, "num_gpus": gpus, "max_concurrency": share})
        try:
            pool.hire(min(max(wanted(), 1), len(windows)))
            yield from pool.outcomes(windows, wanted)
        finally:
            pool.dismiss()


@contextmanager
def _joined(address: str | None, cores: int) -> Iterator[Any]:
    """The library, connected; whoever was connected before stays so. A cluster begun here has so many cores.

    Raises:
        ImportError: The extra `ray` is not installed.
        BatchError: There is no cluster at the address.
    """
    ray = require("ray", extra="ray")
    if ray.is_initialized():
        yield ray
        return
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
    try:
        if address is None:
            ray.init(address="local", num_cpus=cores, include_dashboard=False, **quiet)
        else:
            _check_reachable(address)
            ray.init(address=address, **quiet)
    except (OSError, RuntimeError, ValueError) as error:
        raise BatchError(f"ray_address: cannot join {address!r}: {error}") from error
    try:
        yield ray
    finally:
        ray.shutdown()


def _check_reachable(address: str) -> None:
    """Ray itself tries for minutes before it gives up."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon:
        socket.create_connection((host, int(port)), timeout=CONNECT_S).close()


class _Pool:
    """Workers and what they are at."""

    def __init__(self, ray: Any, work: FrameWork, resources: dict[str, Any]) -> None:  # noqa: ANN401
        self._ray = ray
        self._share: int = resources["max_concurrency"]
        # a worker that dies is replaced here, so that a frame that kills is not tried for ever
        self._class = ray.remote(RayWorker).options(max_restarts=0, max_task_retries=0, **resources)
        try:
            self._work = ray.put(work)
        except (TypeError, pickle.PicklingError) as error:
            raise BatchError(f"source: cannot be sent to other processes: {error}") from error
        self._folder = work.out
        self._holder = (work.out / HOLDER_NAME).read_text(encoding="utf-8")
        self._tasks: dict[Any, tuple[Any, Frames]] = {}
        self._alive: set[Any] = set()
        self._notes: dict[Any, Path] = {}
        self._noted: dict[str, Outcome] = {}
        self._deaths: Counter[Frames] = Counter()
        self._stillbirths = 0

    def hire(self, count: int) -> None:
        for _ in range(count):
            worker = self._class.remote()
            self._alive.add(worker)
            # swept with all that is unfinished, if nobody is left to take it away
            notes = self._notes[worker] = self._folder / f".worker-{secrets.token_hex(6)}{UNFINISHED}"
            notes.touch(exist_ok=False)
            opened = worker.open.remote(self._work, _ldls.__version__, self._holder, notes.name)
            self._tasks[opened] = (worker, STARTING)

    def dismiss(self) -> None:
        for worker in self._alive:
            # whatever state it is in
            with contextlib.suppress(Exception):
                self._ray.kill(worker)
        for notes in self._notes.values():
            notes.unlink(missing_ok=True)

    def outcomes(self, windows: Sequence[Frames], wanted: Callable[[], int]) -> Iterator[Outcome]:
        waiting = deque(windows)
        idle: deque[Any] = deque()
        n_left = len(windows)
        looked = time.monotonic()
        while n_left:
            if time.monotonic() - looked > LOOK_S:
                self.hire(min(wanted() - len(self._alive), len(waiting)))
                looked = time.monotonic()
            while idle and waiting:
                worker = idle.popleft()
                if worker in self._alive:
                    frames = waiting.popleft()
                    self._tasks[worker.do.remote(frames)] = (worker, frames)
            finished, _ = self._ray.wait(list(self._tasks), num_returns=1, timeout=LOOK_S)
            for task in finished:
                worker, frames = self._tasks.pop(task)
                outcome = self._result(task, worker, frames)
                if frames == STARTING:
                    idle.extend([worker] * self._share)
                elif outcome is None:
                    waiting.appendleft(frames)
                else:
                    idle.append(worker)
                    n_left -= 1
                    yield outcome

    def _result(self, task: Any, worker: Any, frames: Frames) -> Outcome | None:  # noqa: ANN401
        """What came of a window; None for one that was lost with its worker and must be done again, or for a start."""
        errors = self._ray.exceptions
        try:
            outcome: Outcome | None = self._ray.get(task)
        except (errors.RayActorError, errors.RayTaskError) as error:
            if isinstance(error, errors.RayTaskError) and worker in self._alive:
                # a full disk, for one: what stops a run on one machine stops it here
                raise getattr(error, "cause", None) or error from None
            self._replace(worker, frames, error)
            if frames == STARTING or frames[0][1] in self._noted:
                return None if frames == STARTING else self._noted.pop(frames[0][1])
            self._deaths[frames] += 1
            return _killer(frames) if self._deaths[frames] >= MAX_DEATHS else None
        if frames == STARTING:
            self._stillbirths = 0
        return outcome

    def _replace(self, worker: Any, frames: Frames, death: Exception) -> None:  # noqa: ANN401
        if frames == STARTING:
            self._stillbirths += 1
            if self._stillbirths > MAX_STILLBIRTHS:
                raise BatchError(f"workers die before they are ready: {death}") from death
        # all windows of a worker come back with its death; one successor is enough
        if worker in self._alive:
            self._alive.remove(worker)
            # one that is only out of reach must not go on
            with contextlib.suppress(Exception):
                self._ray.kill(worker)
            in_hand = [frames, *(window for other, window in self._tasks.values() if other == worker)]
            self._noted |= _noted(self._notes.pop(worker), {window[0][1] for window in in_hand if window})
            self.hire(1)


def _noted(notes: Path, firsts: set[str]) -> dict[str, Outcome]:
    """The outcomes of windows that a worker noted, by the names of their first frames, of those that are asked for.

    Its notes are taken away, and it writes no more without them.
    """
    taken = notes.with_name(f".taken{notes.name}")
    try:
        notes.replace(taken)
    except FileNotFoundError:
        return {}
    outcomes = []
    for line in taken.read_bytes().splitlines():
        # the last one may be cut off
        with contextlib.suppress(ValueError):
            outcomes.append(Outcome(**json.loads(line)))
    taken.unlink()
    by_first = {outcome.records[0]["frame"]: outcome for outcome in outcomes}
    return {first: outcome for first, outcome in by_first.items() if first in firsts}


def _killer(frames: Frames) -> Outcome:
    message = f"{MAX_DEATHS} workers died of it; is memory short?"
    error = {"stage": "worker", "code": "worker_died", "message": message}
    return Outcome([{"frame": name, "error": error} for _, name in frames])
