"""Many frames, written two at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from os import PathLike, fspath
from typing import Protocol

import numpy as np

from ldls.errors import ParameterError
from ldls.simulation.errors import SegmenterErrors, SensorErrors
from ldls.simulation.frame import SceneFrame, scene_frame
from ldls.simulation.kitti_layout import is_whole, write_kitti
from ldls.simulation.rig import make_rig

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Processes already fill the cores."""


@dataclass(frozen=True, kw_only=True)
class FrameOrder:
    """One frame to be made.

    Attributes:
        name: Six digits.
        seed: Seed of the scene and its noise.
        kind: `street` or `campus`.
        lidar: Name of a lidar.
        camera: Name of a set of cameras.
        segmenter: How wrong the masks are.
        sensors: How wrong calibration and clocks are.
    """

    name: str
    seed: int
    kind: str = "street"
    lidar: str = "hdl-64e"
    camera: str = "kitti"
    segmenter: SegmenterErrors
    sensors: SensorErrors

    def is_whole(self, folder: str | PathLike[str]) -> bool:
        """Whether the frame is in `folder`."""
        return is_whole(folder, self.name)

    def make(self, folder: str | PathLike[str]) -> FrameSummary:
        """Write the frame; what it holds."""
        rig = make_rig(lidar=self.lidar, camera=self.camera)
        frame = scene_frame(self.seed, kind=self.kind, rig=rig, segmenter=self.segmenter, sensors=self.sensors)
        write_kitti(folder, self.name, frame)
        return summary_of(self.name, frame)


@dataclass(frozen=True)
class FrameSummary:
    """What a written frame holds.

    Attributes:
        name: Six digits.
        points: Points of the sweep.
        objects: How many objects have points, by COCO id.
        object_points: How many points these have, by COCO id.
        masks: Masks that the segmenter found ahead.
    """

    name: str
    points: int
    objects: dict[int, int]
    object_points: dict[int, int]
    masks: int


class Order(Protocol):
    """Something that makes a frame."""

    def is_whole(self, folder: str | PathLike[str]) -> bool:
        """Whether the frame is in `folder`."""
        ...

    def make(self, folder: str | PathLike[str]) -> FrameSummary:
        """Write the frame; what it holds."""
        ...


def make_frames(
    folder: str | PathLike[str], orders: Sequence[Order], *, processes: int = 2
) -> Iterator[FrameSummary | None]:
    """Write the frames that are not whole in `folder` yet; yields each as it is done, None for one that was there.

    With more than one process, call it from a script's main part only, as Python starts processes anew.

    Raises:
        ParameterError: `processes` is below 1.
        ImportError: `ldls[sim]` is not installed.
    """
    if processes < 1:
        raise ParameterError(f"processes: got {processes}, expected 1 or more")
    missing = [order for order in orders if not order.is_whole(folder)]
    yield from [None] * (len(orders) - len(missing))
    if processes == 1 or len(missing) < 2:
        yield from (make_frame(fspath(folder), order) for order in missing)
        return
    with _environment(ONE_THREAD), ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(make_frame, fspath(folder), order) for order in missing]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def make_frame(folder: str, order: Order) -> FrameSummary:
    """Write one frame; what it holds."""
    return order.make(folder)


def summary_of(name: str, frame: SceneFrame) -> FrameSummary:
    """What a frame holds."""
    seen = np.unique(frame.instances[frame.instances > 0])
    kinds, counts = np.unique([frame.objects[m - 1].category for m in seen], return_counts=True)
    labels, points = np.unique(frame.categories[frame.categories > 0], return_counts=True)
    return FrameSummary(
        name=name,
        points=len(frame.points),
        objects={int(k): int(c) for k, c in zip(kinds, counts, strict=True)},
        object_points={int(k): int(c) for k, c in zip(labels, points, strict=True)},
        masks=len(frame.masks),
    )


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """The environment with `values` that are not set already, for processes started within."""
    added = {key: value for key, value in values.items() if key not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for key in added:
            os.environ.pop(key, None)
