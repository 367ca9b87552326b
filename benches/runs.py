"""Many frames: in memory, and by `ldls run` from a folder in KITTI's object layout, which has one over and over."""

from __future__ import annotations

import argparse
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image
from rich.table import Table

import ldls
from benches.frames import Frame
from benches.measuring import medians, new_table
from ldls import batch
from ldls.simulation.kitti_layout import calibration_lines, write_lines


def write_frames(folder: Path, frame: Frame, count: int) -> tuple[Path, Path]:
    """Write `count` frames; the folders of the frames and of their masks."""
    height, width = frame.masks.image_size
    training, masks = folder / "training", folder / "masks"
    suffixes = {training / "velodyne": ".bin", training / "calib": ".txt", training / "image_2": ".png", masks: ".json"}
    paths = {parent: folder / f"frame{suffix}" for parent, suffix in suffixes.items()}
    for parent in paths:
        parent.mkdir(parents=True)
    np.ascontiguousarray(frame.points[:, :4], "<f4").tofile(paths[training / "velodyne"])
    write_lines(paths[training / "calib"], calibration_lines(frame.camera))
    Image.new("RGB", (width, height)).save(paths[training / "image_2"])
    ldls.save(frame.masks, paths[masks])
    for parent, path in paths.items():
        for number in range(count):
            (parent / f"{number:06d}{path.suffix}").symlink_to(path)
    return training, masks


def loop(frame: Frame, count: int, params: ldls.Params) -> None:
    """Segment the frame `count` times, as one worker would."""
    diffusion = ldls.LabelDiffusion(frame.camera, params)
    for _ in range(count):
        diffusion.segment(frame.points, frame.masks)


def one_a_thread(frame: Frame, count: int, threads: int) -> None:
    """Segment the frame `count` times, `threads` at a time, each on a thread of its own."""
    stream = ldls.LabelDiffusion(frame.camera, ldls.Params(threads=1))
    with ThreadPoolExecutor(threads) as workers:
        list(workers.map(lambda _: stream.segment(frame.points, frame.masks), range(count)))


def in_memory(measured: Frame, options: argparse.Namespace) -> Table:
    """Frames of a batch one after the other on all threads, against one a thread."""
    frames = 8 * options.threads
    table = new_table(
        f"{frames} frames, {measured.name}", ["frames", "ms a frame", "ratio"], f"{options.threads} threads"
    )

    found = medians(
        {
            "one after the other": partial(loop, measured, frames, ldls.Params(threads=options.threads)),
            "one a thread": partial(one_a_thread, measured, frames, options.threads),
        },
        runs=min(options.runs, 7),
    )
    for name, seconds in found.items():
        table.add_row(name, f"{seconds / frames * 1e3:.2f}", f"{found['one after the other'] / seconds:.2f} x")
    return table


def from_disk(measured: Frame, options: argparse.Namespace) -> Table:
    """`ldls run` over many frames from the disk, against LabelDiffusion in a loop on one core."""
    count, one_core = min(2000, options.most), ldls.Params(threads=1)
    table = new_table(
        f"{count:,} frames, {measured.name}",
        ["round", "loop on one core, frames/s", f"run on {options.threads}, frames/s", "share of loop x workers"],
        "points, calibration and masks from the disk, labels to the disk",
    )
    with tempfile.TemporaryDirectory() as folder:
        training, stored = write_frames(Path(folder), measured, count)
        settings = batch.RunSettings(masks=str(stored))
        for number in range(1, 4):
            seconds = medians({"loop": lambda: loop(measured, 50, one_core)}, runs=3)["loop"]
            summary = batch.run(training, Path(folder) / f"out{number}", settings, workers=options.threads)
            own = 50 / seconds
            share = summary.frames_per_second / own / options.threads
            table.add_row(str(number), f"{own:.1f}", f"{summary.frames_per_second:.1f}", f"{share:.0%}")
    return table
