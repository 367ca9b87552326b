"""Many frames as files, several at a time, and the suite: frames by fixed seeds, with errors of fixed strengths."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from os import PathLike, fspath
from pathlib import Path
from typing import Protocol

import numpy as np

from ldls.checks import choice, hold_python_values
from ldls.errors import ParameterError
from ldls.simulation.error_model import SegmenterErrors, SensorErrors
from ldls.simulation.kitti_layout import check_there, write_kitti, write_lines
from ldls.simulation.rigs import make_rig
from ldls.simulation.simulated_frame import SimulatedFrame, scene_frame

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Processes already fill the cores."""
SUITE_VERSION = "suite-v2"
"""Changes whenever a frame of the suite does, so that a cache never mixes two suites."""
SUITE_SEEDS: dict[str, range] = {"validation": range(1000, 1200), "tuning": range(2000, 2020)}
"""Seeds of each part."""
SUITE_SEGMENTER = SegmenterErrors(bleed_px=0, bleed_cells=3.4, missed=0.03, invented=0.8)
SUITE_SENSORS = SensorErrors(rotation_deg=0.1, translation_m=0.02)
"""Strengths chosen on the tuning part, so that direct projection scores near the paper's: car 60.7, pedestrian 48.8."""


class Order(Protocol):
    """A frame to be made and written."""

    @property
    def name(self) -> str:
        """Name of the frame."""
        ...

    def is_whole(self, folder: str | PathLike[str]) -> bool:
        """True where the frame is in `folder` with all its files.

        Raises:
            ParameterError: Another frame is in its place.
        """
        ...

    def make(self, folder: str | PathLike[str]) -> SimulatedFrame:
        """Make and write the frame."""
        ...


@dataclass(frozen=True, kw_only=True)
class FrameOrder:
    """A frame of a single scene, in KITTI's object layout.

    Attributes:
        name: Six digits.
        seed: Seed of the scene and its noise.
        kind: `street` or `campus`.
        lidar: Name of a lidar.
        camera: Name of a set of cameras.
        segmenter: Errors of the masks.
        sensors: Errors of calibration and clocks.
    """

    name: str
    seed: int
    kind: str = "street"
    lidar: str = "hdl-64e"
    camera: str = "kitti"
    segmenter: SegmenterErrors
    sensors: SensorErrors

    def __post_init__(self) -> None:
        hold_python_values(self)

    def is_whole(self, folder: str | PathLike[str]) -> bool:
        """True where the frame is in `folder`; its annotations come last.

        Raises:
            ParameterError: It is made of something else.
        """
        training = Path(folder) / "training"
        if not (training / "annotations" / f"{self.name}.txt").is_file():
            return False
        check_there(training, {self._noted(folder): self._made_of()}, "frames that are made of something else")
        return True

    def make(self, folder: str | PathLike[str]) -> SimulatedFrame:
        """Make and write the frame."""
        write_lines(self._noted(folder), self._made_of())
        rig = make_rig(lidar=self.lidar, camera=self.camera)
        frame = scene_frame(self.seed, kind=self.kind, rig=rig, segmenter=self.segmenter, sensors=self.sensors)
        write_kitti(folder, self.name, frame)
        return frame

    def _noted(self, folder: str | PathLike[str]) -> Path:
        return Path(folder) / "training" / "made_of" / f"{self.name}.json"

    def _made_of(self) -> list[str]:
        return json.dumps(asdict(self), indent=1).splitlines()


@dataclass(frozen=True)
class FrameSummary:
    """Counts of a written frame.

    Attributes:
        name: Name of the frame.
        points: Points of the sweep.
        objects: Objects with points, by category.
        object_points: Points of objects, by category.
        masks: Masks that the segmenter found ahead.
    """

    name: str
    points: int
    objects: dict[int, int]
    object_points: dict[int, int]
    masks: int


def make_frames(
    folder: str | PathLike[str], orders: Sequence[Order], *, processes: int = 2
) -> Iterator[FrameSummary | None]:
    """Write the frames that are not whole in `folder` yet; yields each as it is done, None for one that was there.

    With more than one process, call it from a script's main part only, as Python starts processes anew.

    Raises:
        ParameterError: `processes` is below 1, or a frame that is there is made of something else.
        ImportError: `ldls[sim]` is not installed.
    """
    check_processes(processes)
    missing = [order for order in orders if not order.is_whole(folder)]
    yield from [None] * (len(orders) - len(missing))
    if processes == 1 or len(missing) < 2:
        yield from (_make_frame(fspath(folder), order) for order in missing)
        return
    with _one_thread(), ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(_make_frame, fspath(folder), order) for order in missing]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def check_processes(processes: int) -> None:
    """Refuse to work with none.

    Raises:
        ParameterError: `processes` is below 1.
    """
    if processes < 1:
        raise ParameterError(f"processes: got {processes}, expected 1 or more")


def suite_orders(part: str = "validation") -> list[FrameOrder]:
    """The frames of a part of the suite, with KITTI's lidar and camera.

    Raises:
        ParameterError: There is no such part.
    """
    seeds = SUITE_SEEDS[choice("suite", part, SUITE_SEEDS)]
    return seeded_orders(seeds, segmenter=SUITE_SEGMENTER, sensors=SUITE_SENSORS)


def seeded_orders(
    seeds: Sequence[int],
    *,
    lidar: str = "hdl-64e",
    segmenter: SegmenterErrors | None = None,
    sensors: SensorErrors | None = None,
) -> list[FrameOrder]:
    """A frame for each seed with the usual errors or others, streets of even and campuses of odd ones, from 0."""
    return [
        FrameOrder(
            name=f"{number:06d}",
            seed=seed,
            kind="campus" if seed % 2 else "street",
            lidar=lidar,
            segmenter=segmenter or SegmenterErrors(),
            sensors=sensors or SensorErrors(),
        )
        for number, seed in enumerate(seeds)
    ]


def suite_folder(part: str = "validation") -> Path:
    """Folder that a part is kept in: below LDLS_CACHE if it is set, else below ~/.cache/ldls.

    Raises:
        ParameterError: LDLS_CACHE is no folder, or there is no home.
    """
    cache = os.environ.get("LDLS_CACHE")
    try:
        folder = Path(cache) if cache else Path.home() / ".cache" / "ldls"
    except RuntimeError:
        raise ParameterError("LDLS_CACHE: is not set, and there is no home folder; set it to a folder") from None
    if folder.exists() and not folder.is_dir():
        raise ParameterError(f"LDLS_CACHE: {folder} is no folder; set it to one, or to a path where one can be made")
    return folder / SUITE_VERSION / part


def make_suite(part: str = "validation", *, processes: int = 2) -> Iterator[FrameSummary | None]:
    """Make the frames of a part that are not in the cache yet; yields as `make_frames` does.

    Raises:
        ParameterError: There is no such part.
        ImportError: `ldls[sim]` is not installed.
    """
    return make_frames(suite_folder(part), suite_orders(part), processes=processes)


def suite(part: str = "validation", *, processes: int = 2) -> Path:
    """Folder, in KITTI's object layout, of a part of the suite; its missing frames are made first.

    Raises:
        ParameterError: There is no such part.
        ImportError: `ldls[sim]` is not installed.
    """
    for _ in make_suite(part, processes=processes):
        pass
    return suite_folder(part)


def _make_frame(folder: str, order: Order) -> FrameSummary:
    frame = order.make(folder)
    points = np.bincount(frame.truth.instances, minlength=len(frame.objects) + 1)[1:].tolist()
    objects, object_points = Counter[int](), Counter[int]()
    for thing, count in zip(frame.objects, points, strict=True):
        if count:
            objects[thing.category] += 1
            object_points[thing.category] += count
    return FrameSummary(order.name, len(frame.points), objects, object_points, len(frame.images[0].masks))


@contextmanager
def _one_thread() -> Iterator[None]:
    """The environment with `ONE_THREAD`, as far as it is not set already, for processes started within."""
    added = {key: value for key, value in ONE_THREAD.items() if key not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for key in added:
            os.environ.pop(key, None)
