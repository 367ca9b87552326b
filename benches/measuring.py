"""Medians of runs that alternate, so that a noisy machine disturbs both sides alike."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

Key = TypeVar("Key", bound=Hashable)


def medians(candidates: Mapping[Key, Callable[[], object]], *, runs: int) -> dict[Key, float]:
    """Median seconds of each candidate over `runs` rounds, after one round to warm up."""
    seconds: dict[Key, list[float]] = {name: [] for name in candidates}
    for round_number in range(runs + 1):
        for name, candidate in candidates.items():
            start = time.perf_counter()
            candidate()
            elapsed = time.perf_counter() - start
            if round_number > 0:
                seconds[name].append(elapsed)
    return {name: statistics.median(times) for name, times in seconds.items()}
