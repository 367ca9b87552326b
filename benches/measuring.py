"""Medians of runs that alternate, so that a noisy machine disturbs both sides alike, and the tables of them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

import numpy as np
from rich.table import Table

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


def new_table(title: str, headings: list[str], caption: str) -> Table:
    table = Table(title=title, caption=caption)
    table.add_column(headings[0])
    for heading in headings[1:]:
        table.add_column(heading, justify="right")
    return table


def add_ratio(table: Table, name: str, peer: float, own: float) -> None:
    ratio = peer / own if own > 0 else np.inf
    table.add_row(name, f"{peer * 1e3:.1f}", f"{own * 1e3:.2f}", f"{ratio:.1f} x")
