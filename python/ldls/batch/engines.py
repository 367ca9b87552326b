"""Where frames are segmented."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from ldls.batch.frame_work import FrameWork
from ldls.batch.local import run_local
from ldls.batch.outcome import Outcome
from ldls.errors import ParameterError

Engine = Callable[[FrameWork, Sequence[tuple[int, str]]], Iterator[Outcome]]
"""Yields what becomes of frames, given as number and name, in the order in which they are finished."""


def _local(workers: int) -> Engine:
    return partial(run_local, workers=workers)


ENGINES: dict[str, Callable[[int], Engine]] = {"local": _local}
"""What makes each engine, of the number of workers."""


def open_engine(engine: str | Engine, workers: int) -> Engine:
    """The engine of a name.

    Raises:
        ParameterError: There is no such engine.
    """
    if not isinstance(engine, str):
        return engine
    if engine not in ENGINES:
        raise ParameterError(f"engine: got {engine!r}, expected one of {', '.join(ENGINES)}")
    return ENGINES[engine](workers)
