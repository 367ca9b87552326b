"""`python -m benches`: how much faster than what else one would use, how times spread, and how time and memory grow."""

from __future__ import annotations

import argparse
import os
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module

from rich.console import Console

import ldls
from benches.frames import frame

MISSING = "not measured: run pip install '.[bench]'"

SECTIONS = {
    "scipy": "scipy_pipeline.against_scipy",
    "suite": "times.suite",
    "learners": "learners.against_learners",
    "neighbors": "neighbor_peers.neighbors",
    "growth": "times.growth",
    "instances": "times.instances",
    "products": "times.products",
    "overlaps": "times.overlaps",
    "threads": "times.threads",
    "batch": "runs.in_memory",
    "runs": "runs.from_disk",
    "masks": "mask_coding.masks",
    "cameras": "rings.cameras",
    "ground": "ground_peer.ground",
    "drives": "drives.errors_and_tracks",
    "long-drives": "drives.numbers",
}
"""What makes the table of each: a function of the measured frame and the options, imported when it is asked for."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benches", description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="rounds of each comparison (default: 20)")
    every_core = ldls._ldls.default_threads()
    parser.add_argument("--threads", type=int, default=every_core, help="threads of all sides (default: all cores)")
    parser.add_argument("--most", type=int, default=1_000_000, help="points of the largest cloud (default: 1000000)")
    parser.add_argument("--frames", type=int, default=20, help="frames of the suite, of 200 (default: 20)")
    parser.add_argument("--drives", type=int, default=2, help="simulated drives of each lidar (default: 2)")
    parser.add_argument("sections", nargs="*", choices=[[], *SECTIONS], help="what to measure (default: all)")
    options = parser.parse_args()
    # read when the peers are first imported; threads that spin when their work is done would slow the next one's
    os.environ |= {"OMP_NUM_THREADS": str(options.threads), "OMP_WAIT_POLICY": "PASSIVE"}
    console, measured = Console(width=120), frame()
    with quiet_blas():
        for section in options.sections or SECTIONS:
            try:
                module, _, table = SECTIONS[section].partition(".")
                console.print(getattr(import_module(f"benches.{module}"), table)(measured, options))
            except ImportError as error:
                console.print(f"{section}: {error.name} is {MISSING}")


def quiet_blas() -> AbstractContextManager[object]:
    """Keeps NumPy's BLAS to one thread: its products here are tiny, and its idle threads spin on the others' cores."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return nullcontext()
    return threadpool_limits(1, user_api="blas")  # type: ignore[no-any-return]


if __name__ == "__main__":
    main()
