"""Frames that are labelled together, on their way through the stages of a run; a frame that fails drops out alone."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ldls.batch.known_files import State
from ldls.datasets import CameraImage, Frame
from ldls.masks import InstanceMasks
from ldls.segmentation import Segmentation
from ldls.sequences import Sweep
from ldls.view import View

Frames = tuple[tuple[int, str], ...]
"""Number in the source and name of frames that are labelled together, in their order."""


@dataclass(frozen=True)
class Outcome:
    """A window that is finished; its frames well or not.

    Attributes:
        records: The line of the journal of each frame (journal.py).
        seconds: Time that each stage took.
    """

    records: Sequence[Mapping[str, Any]]
    seconds: Mapping[str, float] = field(default_factory=dict)


class StageError(Exception):
    """An error of one frame, and the stage at which it happened."""

    def __init__(self, stage: str, error: Exception) -> None:
        """The `error` of `stage`."""
        super().__init__(str(error))
        self.stage = stage
        self.error = error


@dataclass(eq=False)
class Work:
    """A frame on its way through the stages.

    Attributes:
        index: Its number in the source.
        name: Its name.
        frame: What was read.
        stamp: Time of its sweep in seconds, where it is known.
        pose: (4, 4) T_world_lidar, where it is known.
        images: The images of the frame, for its picture.
        masks: Stored masks of each image.
        views: Masks and camera of each image.
        sweep: What is labelled together with other frames.
        together: Names of the frames that were labelled together, its own among them.
        inputs: States of the files that it is made of, by path.
        earlier: What the journal says of it, if an earlier run did it.
        kept: Its files of earlier runs that need not be written again, with size and digest; None as long as nobody
            has looked.
        missing: The formats that are to be written of it then.
        result: What came of it.
        record: Its line for the journal.
        error: Why it failed, if it did.
        seconds: Time that each stage took.
    """

    index: int
    name: str
    frame: Frame | None = None
    stamp: float | None = None
    pose: NDArray[np.float64] | None = None
    images: tuple[CameraImage, ...] = ()
    masks: tuple[InstanceMasks, ...] | None = None
    views: tuple[View, ...] = ()
    sweep: Sweep | None = None
    together: Sequence[str] = ()
    inputs: dict[str, State] = field(default_factory=dict)
    earlier: Mapping[str, Any] | None = None
    kept: Mapping[str, list[int | str]] | None = None
    missing: Sequence[str] = ()
    result: Segmentation | None = None
    record: Mapping[str, Any] | None = None
    error: StageError | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    def close(self) -> Mapping[str, Any]:
        """The line of the journal of a frame that went through all stages, or failed at one."""
        if self.error is None:
            assert self.record is not None
            return self.record
        cause = self.error.error
        record = {
            "stage": self.error.stage,
            "code": getattr(cause, "code", type(cause).__name__),
            "message": str(cause) or type(cause).__name__,
        }
        return {"frame": self.name, "error": record}


@dataclass(eq=False)
class Window:
    """Frames on their way that are labelled together.

    Attributes:
        works: One for each, in their order.
    """

    works: tuple[Work, ...]

    @classmethod
    def of(cls, frames: Frames) -> Self:
        """The window of `frames`."""
        return cls(tuple(Work(index, name) for index, name in frames))

    @property
    def sound(self) -> list[Work]:
        """The frames that did not fail."""
        return [work for work in self.works if work.error is None]

    def each(self, do: Callable[[Work], None]) -> None:
        """Do something with each frame that did not fail; those of which it cannot be done fail."""
        for work in self.sound:
            try:
                do(work)
            except StageError as error:
                work.error = error

    def outcome(self) -> Outcome:
        """The outcome of a window with all stages done."""
        seconds: Counter[str] = Counter()
        for work in self.works:
            seconds.update(work.seconds)
        return Outcome([work.close() for work in self.works], dict(seconds))


@contextmanager
def stage(work: Work, name: str) -> Iterator[None]:
    """Take the time of a stage of a frame.

    Raises:
        StageError: It fails, and the frame is at fault.
        OSError: It cannot be written.
    """
    start = time.perf_counter()
    try:
        yield
    except Exception as error:
        if isinstance(error, MemoryError | ImportError):
            # no frame is at fault if memory or an extra is missing
            raise
        if name == "write" and isinstance(error, OSError):
            # a full disk is no fault of the frame
            hint = f"{error.strerror or error} while writing frame {work.name}; mend it and give the same command again"
            raise OSError(error.errno, hint, error.filename) from error
        raise StageError(name, error) from error
    finally:
        work.seconds[name] = work.seconds.get(name, 0.0) + time.perf_counter() - start
