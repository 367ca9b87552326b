"""The engines that segment the frames of a run."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
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


def open_engine(
    engine: str | Engine, *, workers: int | None = None, ray_address: str | None = None, gpus: float = 0.0
) -> Engine:
    """The engine of a name, with the options that concern it.

    Args:
        engine: "local", "ray", or an engine, which is opened already.
        workers: Workers at a time; as many as there are cores, or GPUs where workers need them, by default.
        ray_address: Address of a Ray cluster to join; by default one is started on this machine.
        gpus: GPUs of each worker of a Ray cluster; a part of one is shared.

    Raises:
        ParameterError: There is no such engine, or an option is out of its range or for another.
    """
    if workers is not None and not 1 <= workers <= MAX_WORKERS:
        raise ParameterError(f"workers: got {workers}, expected 1 to {MAX_WORKERS}")
    if not (0 <= gpus < 1 or (gpus >= 1 and float(gpus).is_integer())):
        raise ParameterError(f"gpus: got {gpus}, expected a number below 1, or a whole one")
    if not isinstance(engine, str):
        return engine
    if choice("engine", engine, ("local", "ray")) == "ray":
        return partial(run_ray, address=ray_address, workers=workers, gpus=gpus)
    if ray_address is not None or gpus:
        raise ParameterError("ray_address, gpus: are for engine 'ray', got engine 'local'")
    return partial(run_local, workers=workers or _ldls.default_threads())
