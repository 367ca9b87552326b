"""`python -m benches`: how much faster than what else one would use."""

from __future__ import annotations

import argparse
import statistics

import numpy as np
from rich.console import Console
from rich.table import Table

import ldls
from benches import scipy_pipeline
from benches.frames import Frame, frame
from benches.measuring import medians


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benches", description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="rounds of each comparison (default: 20)")
    parser.add_argument("--threads", type=int, default=None, help="threads of ldls (default: all cores)")
    options = parser.parse_args()
    measured = frame()
    threads = options.threads or ldls._ldls.default_threads()
    Console(width=100).print(against_scipy(measured, threads, options.runs))


def against_scipy(measured: Frame, threads: int, runs: int) -> Table:
    """Each stage and the whole of `ldls.segment` against the plain SciPy pipeline."""
    params = ldls.Params(threads=threads)
    dense = measured.masks.to_array()
    stages: dict[str, list[dict[str, float]]] = {"scipy": [], "ldls": []}
    labels = {}

    def run_scipy() -> None:
        labels["scipy"], seconds = scipy_pipeline.segment(measured, params, dense)
        stages["scipy"].append(seconds)

    def run_ldls() -> None:
        result = ldls.segment(measured.points, measured.masks, measured.camera, params=params)
        labels["ldls"] = result.labels[result.in_view]
        stages["ldls"].append(dict(result.timings))

    whole = medians({"scipy": run_scipy, "ldls": run_ldls}, runs=runs)
    differ = int((labels["scipy"] != labels["ldls"]).sum())
    table = Table(
        title=f"{measured.name}: {len(labels['ldls']):,} points in view, {len(measured.masks)} instances",
        caption=f"medians of {runs} runs, ldls on {threads} threads; labels that differ: {differ}",
    )
    table.add_column("stage")
    for heading in ("plain scipy float64, ms", "ldls, ms", "ratio"):
        table.add_column(heading, justify="right")
    for stage in scipy_pipeline.STAGES:
        peer, own = (statistics.median(run[stage] for run in stages[side][1:]) for side in ("scipy", "ldls"))
        _add_ratio(table, stage, peer, own)
    table.add_section()
    _add_ratio(table, "ldls.segment", whole["scipy"], whole["ldls"])
    return table


def _add_ratio(table: Table, name: str, peer: float, own: float) -> None:
    ratio = peer / own if own > 0 else np.inf
    table.add_row(name, f"{peer * 1e3:.1f}", f"{own * 1e3:.2f}", f"{ratio:.1f} x")


if __name__ == "__main__":
    main()
