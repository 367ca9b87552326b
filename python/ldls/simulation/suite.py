"""The suite: 200 validation and 20 tuning scenes by fixed seeds, with errors of a fixed strength."""

from __future__ import annotations

import os
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

from ldls.errors import ParameterError
from ldls.simulation.errors import SegmenterErrors, SensorErrors
from ldls.simulation.production import FrameOrder, FrameSummary, make_frames

VERSION = "suite-v1"
"""Changes whenever a frame of the suite does, so that a cache never mixes two suites."""
SEEDS: dict[str, range] = {"validation": range(1000, 1200), "tuning": range(2000, 2020)}
"""Seeds of each part; even ones are streets, odd ones campuses."""
SEGMENTER = SegmenterErrors(bleed_px=0, bleed_cells=2.8, missed=0.03, wrong_class=0.1, invented=0.8)
SENSORS = SensorErrors(rotation_deg=0.1, translation_m=0.02, delay_s=0.1)
"""Strengths chosen on the tuning part, so that direct projection scores near the paper's: car 61, pedestrian 49."""


def suite_orders(part: str = "validation") -> list[FrameOrder]:
    """The frames of a part of the suite, with KITTI's lidar and camera.

    Raises:
        ParameterError: There is no such part.
    """
    if part not in SEEDS:
        raise ParameterError(f"suite: got {part!r}, expected one of {', '.join(SEEDS)}")
    return [
        FrameOrder(
            name=f"{number:06d}",
            seed=seed,
            kind="campus" if seed % 2 else "street",
            segmenter=SEGMENTER,
            sensors=SENSORS,
        )
        for number, seed in enumerate(SEEDS[part])
    ]


def suite_folder(part: str = "validation") -> Path:
    """Where a part is kept: below LDLS_CACHE if it is set, else below ~/.cache/ldls."""
    cache = os.environ.get("LDLS_CACHE")
    return (Path(cache) if cache else Path.home() / ".cache" / "ldls") / VERSION / part


def make_suite(
    part: str = "validation", *, folder: str | PathLike[str] | None = None, processes: int = 2
) -> Iterator[FrameSummary | None]:
    """Make the frames of a part that are not there yet, in `folder` or the cache; yields as `make_frames` does.

    Raises:
        ParameterError: There is no such part.
        ImportError: `ldls[sim]` is not installed.
    """
    return make_frames(suite_folder(part) if folder is None else folder, suite_orders(part), processes=processes)


def suite(part: str = "validation", *, processes: int = 2) -> Path:
    """Folder, in KITTI's object layout, of a part of the suite; its missing frames are made first.

    Raises:
        ParameterError: There is no such part.
        ImportError: `ldls[sim]` is not installed.
    """
    for _ in make_suite(part, processes=processes):
        pass
    return suite_folder(part)
