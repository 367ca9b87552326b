"""How times spread over frames, and grow with points, instances, products, masks that overlap and threads."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from statistics import median

import numpy as np
from rich.table import Table

import ldls
from benches.frames import Frame, overlapping_boxes, random_frame, street_frame, suite_frames, tiled_frame
from benches.measuring import medians, new_table
from benches.memory import extra_bytes
from benches.runs import one_a_thread


def suite(measured: Frame, options: argparse.Namespace) -> Table:
    """Times of frames of the simulated suite, which are kept in its folder, beside the one frame."""
    methods = {
        "the paper's method": ldls.Params.paper(threads=options.threads),
        "the defaults": ldls.Params(threads=options.threads),
    }

    frames = [measured, *suite_frames(options.frames)]
    # round after round over all frames, so that slow minutes of the machine fall on all of them alike
    calls = {
        (name, at): partial(ldls.segment, frame.points, frame.masks, frame.camera, params=params)
        for name, params in methods.items()
        for at, frame in enumerate(frames)
    }
    runs = min(options.runs, 9)
    seconds = medians(calls, runs=runs)
    table = new_table(
        f"ldls.segment: {len(frames) - 1} frames of the suite",
        ["ms a frame", measured.name, "median", "90 %", "99 %", "worst", "99 % / median"],
        f"a frame's time is the median of {runs} runs, {options.threads} threads",
    )
    for name in methods:
        one_ms, *suite_ms = (1e3 * seconds[name, at] for at in range(len(frames)))
        median, _, high, _ = found = np.percentile(suite_ms, [50, 90, 99, 100])
        table.add_row(name, *(f"{ms:.1f}" for ms in (one_ms, *found)), f"{high / median:.2f} x")
    return table


def growth(measured: Frame, options: argparse.Namespace) -> Table:
    """Time and memory against the number of points, all in view of one camera, 20 instances."""
    params = ldls.Params(threads=options.threads)
    table = new_table(
        "time and memory against points",
        ["points", "s", "over 100,000", "extra bytes a point"],
        f"{options.threads} threads",
    )
    base = 0.0
    for n in (n for n in (10_000, 100_000, 1_000_000, 10_000_000) if n <= options.most):
        tiled = tiled_frame(measured.in_view(), n)
        run = {"ldls": partial(ldls.segment, tiled.points, tiled.masks, tiled.camera, params=params)}
        seconds = medians(run, runs=options.runs if n <= 100_000 else 3)["ldls"]
        base = seconds if n == 100_000 else base
        ratio = f"{seconds / base:.1f} x" if base else ""
        table.add_row(f"{n:,}", f"{seconds:.4f}", ratio, f"{extra_bytes(n) / n:.0f}")
    return table


def instances(measured: Frame, options: argparse.Namespace) -> Table:
    """Time against the number of instances."""
    params = ldls.Params(threads=options.threads)
    table = new_table("time against instances, 100,000 points", ["instances", "ms"], f"{options.threads} threads")
    for count in (0, 1, 5, 20, 100, 500):
        tiled = tiled_frame(measured.in_view(), 100_000, count)
        run = {"ldls": partial(ldls.segment, tiled.points, tiled.masks, tiled.camera, params=params)}
        table.add_row(str(count), f"{medians(run, runs=min(options.runs, 5))['ldls'] * 1e3:.1f}")
    return table


def products(measured: Frame, options: argparse.Namespace) -> Table:
    """Time and sweeps against the number of products."""
    table = new_table("time against products", ["products", "ms", "sweeps"], f"{options.threads} threads")
    for count in (10, 200, 500, 1000, None):
        params = replace(ldls.Params.paper(threads=options.threads), iterations=count)
        segment = partial(ldls.segment, measured.points, measured.masks, measured.camera, params=params)
        seconds = medians({"ldls": segment}, runs=min(options.runs, 9))["ldls"]
        name = "as many as it takes" if count is None else f"{count:,}"
        table.add_row(name, f"{seconds * 1e3:.1f}", str(segment().report.sweeps))
    return table


def overlaps(measured: Frame, options: argparse.Namespace) -> Table:
    """Time under random boxes that overlap, against the same boxes with each pixel left to one."""
    n = min(options.most, 1_000_000)
    table = new_table(
        "20 random boxes",
        ["frame", "parameters", "seed of the boxes", "they overlap, s", "they do not, s", "ratio"],
        f"medians; {options.threads} threads",
    )
    parameters = {
        "the paper's": ldls.Params.paper(threads=options.threads),
        "defaults": ldls.Params(threads=options.threads),
    }
    tiles = tiled_frame(measured.in_view(), n, 0)
    frames = ((tiles, range(8)), (street_frame(n), range(3)), (random_frame(n), range(1)))
    for (name, params), (each, seeds) in product(parameters.items(), frames):
        for seed in seeds:
            boxes = overlapping_boxes(each, seed)
            sides = {
                side: partial(ldls.segment, each.points, masks, each.camera, params=params)
                for side, masks in (("over", boxes), ("alone", boxes.resolve_overlaps("area")))
            }
            found = medians(sides, runs=min(options.runs, 5))
            ratio = f"{found['over'] / found['alone']:.2f} x"
            table.add_row(each.name, name, str(seed), f"{found['over']:.3f}", f"{found['alone']:.3f}", ratio)
    return table


def threads(measured: Frame, options: argparse.Namespace) -> Table:
    """Times against the number of threads: of the frame and its stages, of clouds, and of a frame of a batch."""
    counts = [count for count in (1, 2, 4, 8, 16, 32, 64) if count <= options.threads]
    table = new_table(
        f"ms against threads: {measured.name}",
        ["", *map(str, counts)],
        "and how many times faster than on one; clouds and batches with the defaults",
    )
    laps: dict[int, list[Mapping[str, float]]] = {count: [] for count in counts}

    def segment(frame: Frame, params: ldls.Params, count: int) -> None:
        params = replace(params, threads=count)
        laps[count].append(ldls.segment(frame.points, frame.masks, frame.camera, params=params).timings)

    def add(name: str, frame: Frame, params: ldls.Params, runs: int) -> None:
        calls = {count: partial(segment, frame, params, count) for count in counts}
        add_row(name, medians(calls, runs=runs))

    def add_row(name: str, seconds: Mapping[int, float]) -> None:
        one = seconds[counts[0]]
        table.add_row(name, *(f"{1e3 * each:.2f} ({one / each:.1f} x)" for each in seconds.values()))

    add("the paper's method", measured, ldls.Params.paper(), options.runs)
    for stage in laps[counts[0]][0]:
        add_row(f"  {stage}", {count: median(lap[stage] for lap in laps[count][1:]) for count in counts})
    add("the defaults", measured, ldls.Params(), options.runs)
    for n in (n for n in (100_000, 1_000_000, 10_000_000) if n <= options.most):
        add(f"{n:,} points", tiled_frame(measured.in_view(), n), ldls.Params(), 3)
    batches = {count: partial(one_a_thread, measured, 8 * count, count) for count in counts}
    seconds = medians(batches, runs=min(options.runs, 7))
    add_row("a frame of a batch, one a thread", {count: seconds[count] / (8 * count) for count in counts})
    return table
