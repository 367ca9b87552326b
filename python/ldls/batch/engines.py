"""The engines that segment the frames of a run."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial

import ldls._ldls as _ldls
from ldls.batch.frame_work import FrameWork
from ldls.batch.local import run_local
from ldls.batch.ray_engine import run_ray
from ldls.batch.window import Frames, Outcome
from ldls.checks import choice
from ldls.errors import ParameterError

MAX_WORKERS = 1024

Engine = Callable[[FrameWork, Sequence[Frames]], Generator[Outcome]]
"""Yields what becomes of windows, frames given as number and name, in the order in which they are finished.

It is closed when the run ends, however it does, and is at work no more then."""


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """Options of the engines; each takes those that concern it.

    Attributes:
        workers: Workers at a time; as many as there are cores, or GPUs where workers need them, by default.
        ray_address: Address of a Ray cluster to join; by default one is started on this machine.
        gpus: GPUs of each worker of a Ray cluster; a part of one is shared.

    Raises:
        ParameterError: One is out of its range.
    """

    workers: int | None = None
    ray_address: str | None = None
    gpus: float = 0.0

    def __post_init__(self) -> None:
        if self.workers is not None and not 1 <= self.workers <= MAX_WORKERS:
            raise ParameterError(f"workers: got {self.workers}, expected 1 to {MAX_WORKERS}")
        if not (0 <= self.gpus < 1 or (self.gpus >= 1 and float(self.gpus).is_integer())):
            raise ParameterError(f"gpus: got {self.gpus}, expected a number below 1, or a whole one")


def _local(options: EngineOptions) -> Engine:
    if options.ray_address is not None or options.gpus:
        raise ParameterError("ray_address, gpus: are for engine 'ray', got engine 'local'")
    return partial(run_local, workers=options.workers or _ldls.default_threads())


def _ray(options: EngineOptions) -> Engine:
    return partial(run_ray, address=options.ray_address, workers=options.workers, gpus=options.gpus)


ENGINES: dict[str, Callable[[EngineOptions], Engine]] = {"local": _local, "ray": _ray}
"""Makers of the engines, by name."""


def open_engine(engine: str | Engine, options: EngineOptions) -> Engine:
    """The engine of a name.

    Raises:
        ParameterError: There is no such engine, or an option is for another.
    """
    if not isinstance(engine, str):
        return engine
    return ENGINES[choice("engine", engine, ENGINES)](options)
