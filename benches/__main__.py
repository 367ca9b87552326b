"""`python -m benches`: how much faster than what else one would use, how times spread, and how time and memory grow."""

from __future__ import annotations

import argparse
import itertools
import os
import statistics
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table

import ldls
from benches.frames import Frame, frame, overlapping_boxes, street_frame, suite_frames, tiled_frame
from benches.measuring import medians

MISSING = "not measured: run pip install '.[bench]'"


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
                console.print(SECTIONS[section](measured, options))
            except ImportError as error:
                console.print(f"{section}: {error.name} is {MISSING}")


def quiet_blas() -> AbstractContextManager[object]:
    """Keeps NumPy's BLAS to one thread: its products here are tiny, and its idle threads spin on the others' cores."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return nullcontext()
    return threadpool_limits(1, user_api="blas")  # type: ignore[no-any-return]


def against_scipy(measured: Frame, options: argparse.Namespace) -> Table:
    """Each stage of the paper's method and `ldls.segment` against the plain SciPy pipeline."""
    from benches import scipy_pipeline

    params, best = ldls.Params.paper(threads=options.threads), ldls.Params(threads=options.threads)
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

    def run_best() -> None:
        ldls.segment(measured.points, measured.masks, measured.camera, params=best)

    whole = medians({"scipy": run_scipy, "ldls": run_ldls, "best": run_best}, runs=options.runs)
    differ = int((labels["scipy"] != labels["ldls"]).sum())
    table = _table(
        f"{measured.name}: {len(labels['ldls']):,} points in view, {len(measured.masks)} instances",
        ["stage", "plain scipy float64, ms", "ldls, ms", "ratio"],
        f"medians of {options.runs} runs, ldls on {options.threads} threads; labels that differ: {differ}",
    )
    for stage in scipy_pipeline.STAGES:
        peer, own = (statistics.median(run[stage] for run in stages[side][1:]) for side in ("scipy", "ldls"))
        _add_ratio(table, stage, peer, own)
    table.add_section()
    _add_ratio(table, "ldls.segment, the paper's method", whole["scipy"], whole["ldls"])
    _add_ratio(table, "ldls.segment, the defaults", whole["scipy"], whole["best"])
    return table


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
    runs = min(options.runs, 5)
    seconds = medians(calls, runs=runs)
    table = _table(
        f"ldls.segment: {len(frames) - 1} frames of the suite",
        ["ms a frame", measured.name, "median", "90 %", "99 %", "worst", "99 % / median"],
        f"a frame's time is the median of {runs} runs, {options.threads} threads",
    )
    for name in methods:
        one_ms, *suite_ms = (1e3 * seconds[name, at] for at in range(len(frames)))
        median, _, high, _ = found = np.percentile(suite_ms, [50, 90, 99, 100])
        table.add_row(name, *(f"{ms:.1f}" for ms in (one_ms, *found)), f"{high / median:.2f} x")
    return table


def against_learners(measured: Frame, options: argparse.Namespace) -> Table:
    """`ldls.segment` against project + DBSCAN and against label spreading."""
    from benches import learners

    dense, params = measured.masks.to_array(), ldls.Params(threads=options.threads)
    peers: dict[str, tuple[Callable[..., object], int]] = {
        "project + DBSCAN (scikit-learn)": (learners.project_and_cluster, options.runs),
        "LabelSpreading (scikit-learn), 200 iterations": (learners.spread_labels, min(options.runs, 3)),
    }
    table = _table(
        f"{measured.name}: the whole frame",
        ["peer", "peer, ms", "ldls, ms", "ratio"],
        f"{options.threads} threads on both sides",
    )
    for name, (peer, rounds) in peers.items():
        found = medians(
            {
                "peer": lambda peer=peer: peer(measured, dense),  # type: ignore[misc]
                "ldls": lambda: ldls.segment(measured.points, measured.masks, measured.camera, params=params),
            },
            runs=rounds,
        )
        _add_ratio(table, name, found["peer"], found["ldls"])
    return table


def neighbors(measured: Frame, options: argparse.Namespace) -> Table:
    """Nearest neighbours against pykdtree, SciPy and small_gicp."""
    from benches import neighbor_peers

    table = _table(
        "10 nearest neighbours of every point, tree included, ms",
        ["cloud", "points", "ldls", "pykdtree", "scipy", "small_gicp", "pykdtree / ldls"],
        f"medians, {options.threads} threads on all sides",
    )
    sweep = np.ascontiguousarray(measured.points[:, :3])
    for name, cloud in neighbor_peers.clouds(sweep, measured.in_view()).items():
        rounds = options.runs if len(cloud) < 500_000 else min(options.runs, 5)
        found = medians(neighbor_peers.searches(cloud, options.threads), runs=rounds)
        times = [f"{found[peer] * 1e3:.1f}" for peer in ("ldls", "pykdtree", "scipy", "small_gicp")]
        table.add_row(name, f"{len(cloud):,}", *times, f"{found['pykdtree'] / found['ldls']:.2f} x")
    return table


def growth(measured: Frame, options: argparse.Namespace) -> Table:
    """Time and memory against the number of points, all in view of one camera, 20 instances."""
    from benches import memory

    params = ldls.Params(threads=options.threads)
    table = _table(
        "time and memory against points",
        ["points", "s", "over 100,000", "extra bytes a point"],
        f"{options.threads} threads",
    )
    base = 0.0
    for n in (n for n in (10_000, 100_000, 1_000_000, 10_000_000) if n <= options.most):
        tiled = tiled_frame(measured.in_view(), n)
        run = {"ldls": lambda tiled=tiled: ldls.segment(tiled.points, tiled.masks, tiled.camera, params=params)}  # type: ignore[misc]
        seconds = medians(run, runs=options.runs if n <= 100_000 else 3)["ldls"]
        base = seconds if n == 100_000 else base
        ratio = f"{seconds / base:.1f} x" if base else ""
        table.add_row(f"{n:,}", f"{seconds:.4f}", ratio, f"{memory.extra_bytes(n) / n:.0f}")
    return table


def instances(measured: Frame, options: argparse.Namespace) -> Table:
    """Time against the number of instances."""
    params = ldls.Params(threads=options.threads)
    table = _table("time against instances, 100,000 points", ["instances", "ms"], f"{options.threads} threads")
    for count in (0, 1, 5, 20, 100, 500):
        tiled = tiled_frame(measured.in_view(), 100_000, count)
        run = {"ldls": lambda tiled=tiled: ldls.segment(tiled.points, tiled.masks, tiled.camera, params=params)}  # type: ignore[misc]
        table.add_row(str(count), f"{medians(run, runs=min(options.runs, 5))['ldls'] * 1e3:.1f}")
    return table


def overlaps(measured: Frame, options: argparse.Namespace) -> Table:
    """Time under random boxes that overlap, against the same boxes with each pixel left to one."""
    n, params = min(options.most, 1_000_000), ldls.Params.paper(threads=options.threads)
    table = _table(
        "20 random boxes, the paper's method",
        ["frame", "seed of the boxes", "they overlap, s", "they do not, s", "ratio"],
        f"medians; {options.threads} threads",
    )
    for each, seeds in ((tiled_frame(measured.in_view(), n, 0), range(8)), (street_frame(n), range(3))):
        for seed in seeds:
            boxes = overlapping_boxes(each, 20, seed)
            sides = {
                name: partial(ldls.segment, each.points, masks, each.camera, params=params)
                for name, masks in (("over", boxes), ("alone", boxes.resolve_overlaps("area")))
            }
            found = medians(sides, runs=min(options.runs, 5))
            ratio = f"{found['over'] / found['alone']:.2f} x"
            table.add_row(each.name, str(seed), f"{found['over']:.3f}", f"{found['alone']:.3f}", ratio)
    return table


def thread_scaling(measured: Frame, options: argparse.Namespace) -> Table:
    """Time against the number of threads."""
    table = _table(f"time against threads: {measured.name}", ["threads", "ms", "ratio to one"], "")
    counts = [count for count in (1, 2, 4, 8, 16) if count <= options.threads]

    def run(count: int) -> Callable[[], object]:
        params = ldls.Params(threads=count)
        return lambda: ldls.segment(measured.points, measured.masks, measured.camera, params=params)

    found = {count: medians({"ldls": run(count)}, runs=options.runs)["ldls"] for count in counts}
    for count, seconds in found.items():
        table.add_row(str(count), f"{seconds * 1e3:.2f}", f"{found[1] / seconds:.2f} x")
    return table


def batch(measured: Frame, options: argparse.Namespace) -> Table:
    """Frames of a batch one after the other on all threads, against one a thread."""
    frames = 8 * options.threads
    table = _table(f"{frames} frames, {measured.name}", ["frames", "ms a frame", "ratio"], f"{options.threads} threads")

    def one_after_the_other() -> None:
        stream = ldls.LabelDiffusion(measured.camera, ldls.Params(threads=options.threads))
        for _ in range(frames):
            stream.segment(measured.points, measured.masks)

    def one_a_thread() -> None:
        stream = ldls.LabelDiffusion(measured.camera, ldls.Params(threads=1))
        with ThreadPoolExecutor(options.threads) as workers:
            list(workers.map(lambda _: stream.segment(measured.points, measured.masks), range(frames)))

    found = medians(
        {"one after the other": one_after_the_other, "one a thread": one_a_thread}, runs=min(options.runs, 7)
    )
    for name, seconds in found.items():
        table.add_row(name, f"{seconds / frames * 1e3:.2f}", f"{found['one after the other'] / seconds:.2f} x")
    return table


def whole_runs(measured: Frame, options: argparse.Namespace) -> Table:
    """`ldls run` over many frames from the disk, against LabelDiffusion in a loop on one core."""
    import tempfile
    from pathlib import Path

    from benches import runs
    from ldls import batch

    count, one_core = min(2000, options.most), ldls.Params(threads=1)
    table = _table(
        f"{count:,} frames, {measured.name}",
        ["round", "loop on one core, frames/s", f"run on {options.threads}, frames/s", "share of loop x workers"],
        "points, calibration and masks from the disk, labels to the disk",
    )
    with tempfile.TemporaryDirectory() as folder:
        training, stored = runs.write_frames(Path(folder), measured, count)
        settings = batch.RunSettings(masks=str(stored))
        for number in range(1, 4):
            seconds = medians({"loop": lambda: runs.loop(measured, 50, one_core)}, runs=3)["loop"]
            summary = batch.run(training, Path(folder) / f"out{number}", settings, workers=options.threads)
            own = 50 / seconds
            share = summary.frames_per_second / own / options.threads
            table.add_row(str(number), f"{own:.1f}", f"{summary.frames_per_second:.1f}", f"{share:.0%}")
    return table


def masks(_measured: Frame, options: argparse.Namespace) -> Table:
    """Masks of 1920 x 1080 pixels from and to COCO's run lengths, against pycocotools."""
    import warnings

    from pycocotools import mask as coco_tools

    from benches import mask_coding

    warnings.filterwarnings("ignore", "__array__ implementation", DeprecationWarning)
    pixels = mask_coding.outlines()
    rles = mask_coding.encoded(pixels)
    listed = mask_coding.results(rles)
    columns_first = [np.asfortranarray(mask, np.uint8) for mask in pixels]
    sides: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
        "results to pixels": (
            lambda: coco_tools.decode(rles),
            lambda: ldls.InstanceMasks.from_coco(listed).to_array(),
        ),
        "pixels to run lengths": (
            lambda: [coco_tools.encode(mask) for mask in columns_first],
            lambda: ldls.InstanceMasks.from_array(pixels),
        ),
    }
    differ = int((np.moveaxis(coco_tools.decode(rles), -1, 0) != sides["results to pixels"][1]()).sum())
    table = _table(
        f"{mask_coding.COUNT} masks of {mask_coding.WIDTH} x {mask_coding.HEIGHT} pixels",
        ["work", "pycocotools, ms", "ldls, ms", "ratio"],
        f"pycocotools on one thread, ldls on {options.threads}; pixels that differ: {differ}",
    )
    for name, (peer, own) in sides.items():
        found = medians({"peer": peer, "ldls": own}, runs=min(options.runs, 7))
        _add_ratio(table, name, found["peer"], found["ldls"])
    return table


def cameras(_measured: Frame, options: argparse.Namespace) -> Table:
    """A ring of six cameras against each of them alone, by the time a point in view takes."""
    from benches import rings

    name, points, views = rings.ring()
    params = ldls.Params(threads=options.threads)

    def run(some: list[ldls.View]) -> Callable[[], ldls.Segmentation]:
        return lambda: ldls.segment(points, some, params=params)

    sides = {view.name: run([view]) for view in views} | {"ring": run(views)}
    found = medians(sides, runs=options.runs)
    in_view = {side: len(call().in_view) for side, call in sides.items()}
    alone = sum(found[view.name] for view in views) / sum(in_view[view.name] for view in views)
    table = _table(
        name,
        ["cameras", "points in view", "ms", "us a point", "over the six alone"],
        f"{options.threads} threads; the six alone take {alone * 1e6:.2f} us a point and camera",
    )
    for side, seconds in found.items():
        each = seconds / in_view[side]
        table.add_row(side, f"{in_view[side]:,}", f"{seconds * 1e3:.1f}", f"{each * 1e6:.2f}", f"{each / alone:.2f} x")
    return table


def ground(_measured: Frame, options: argparse.Namespace) -> Table:
    """The ground of simulated scenes against Patchwork++: heights, labels and time."""
    from benches import ground_peer, ground_scenes

    seeds = range(4)
    names = ("Patchwork++", "ldls, sweep", "Patchwork++ in view", "ldls in view")
    table = _table(
        f"ground of {2 * len(seeds)} simulated scenes a row",
        ["slopes, lidar", "side", "p50, m", "p90", "p99", "precision", "recall", "IoU", "objects", "ms"],
        "errors of height; objects: points of objects called ground; Patchwork++ is given whole sweeps; one thread",
    )
    for slopes, lidar in itertools.product(ground_scenes.SLOPES, ground_scenes.LIDARS):
        found: dict[str, list[ground_peer.Mistakes]] = {name: [] for name in names}
        seconds: dict[str, list[float]] = {name: [] for name in names}
        for seed, kind in itertools.product(seeds, ("street", "campus")):
            scene = ground_scenes.ground_scene(seed, kind, slopes, lidar)
            whole, rows = np.arange(len(scene.points)), scene.in_view
            in_view, peer = scene.points[rows], ground_peer.Patchwork(scene)
            sides: dict[str, Callable[[], object]] = {
                names[0]: peer.run,
                names[1]: lambda scene=scene: ground_peer.our_ground(scene.points, scene.camera),  # type: ignore[misc]
                names[3]: lambda scene=scene, seen=in_view: ground_peer.our_ground(seen, scene.camera),  # type: ignore[misc]
            }
            for name, median in medians(sides, runs=min(options.runs, 7)).items():
                seconds[name].append(median)
            said = peer.estimate()
            for name, points, estimate in (
                (names[0], whole, said),
                (names[1], whole, ground_peer.our_ground(scene.points, scene.camera)),
                (names[2], rows, said.of(rows)),
                (names[3], rows, ground_peer.our_ground(in_view, scene.camera)),
            ):
                found[name].append(ground_peer.mistakes(scene, points, estimate))
        for name in names:
            ms = f"{statistics.median(seconds[name]) * 1e3:.1f}" if seconds[name] else ""
            table.add_row(f"{slopes}, {lidar}", name, *ground_peer.Mistakes.joined(found[name]).row(), ms)
        table.add_section()
    return table


def drives(measured: Frame, options: argparse.Namespace) -> Table:
    """Errors, tracks and times of windows of sweeps against those of each sweep alone, on simulated drives."""
    from benches import drives as simulated

    table = _table(
        f"drives of 20 sweeps, {options.drives} of each lidar",
        ["lidar", "sweeps together", "error car", "error person", "S_assoc", "switches a hundred", "ms a sweep"],
        "error: 100 less the IoU of all points in view, in %; wrong poses: 5 cm and 0.3 degrees off, of a moment 50 ms "
        f"off; {options.threads} threads",
    )
    for lidar in ("vlp-16", "hdl-64e"):
        of_lidar = list(simulated.drives(lidar, options.drives))
        off = [simulated.with_wrong_poses(drive, seed) for seed, drive in enumerate(of_lidar)]
        for together, size, of_drives in (("1", 1, of_lidar), ("5", 5, of_lidar), ("5, wrong poses", 5, off)):
            found, tracks, seconds = simulated.scores(of_drives, size, options.threads)
            errors = [f"{100 - 100 * (found.semantic[name].iou or 0.0):.1f}" for name in simulated.CLASSES]
            association = (f"{tracks.s_assoc or 0.0:.2f}", f"{tracks.switches_per_100 or 0.0:.2f}")
            table.add_row(lidar, together, *errors, *association, f"{seconds * 1e3:.1f}")
    return table


def long_drives(_measured: Frame, options: argparse.Namespace) -> Table:
    """Numbers of objects over drives of which masks are left out."""
    from benches import drives as simulated

    table = _table(
        f"{options.drives} drives of {simulated.LONG} sweeps of a VLP-16, twice each",
        ["sweeps together", "S_assoc", "LSTQ", "switches a hundred", "switches of standing cars"],
        f"masks in random order, {simulated.MISSED:.0%} of them left out and all of {simulated.GAP} sweeps in a row; "
        "means of the drives, but switches of all object frames and of each drive",
    )
    of_lidar = list(simulated.long_drives("vlp-16", options.drives))
    for size in (1, 5):
        twice = itertools.product(of_lidar, range(2))
        scores = [simulated.long_scores(*drive, size, seed, options.threads) for drive, seed in twice]
        tracks, of_standing = zip(*scores, strict=True)
        association = statistics.mean(of_drive.s_assoc or 0.0 for of_drive in tracks)
        quality = statistics.mean(of_drive.lstq or 0.0 for of_drive in tracks)
        switches = 100 * sum(t.id_switches for t in tracks) / sum(t.object_frames for t in tracks)
        each = " ".join(str(count) for count in of_standing)
        table.add_row(f"{size}", f"{association:.3f}", f"{quality:.3f}", f"{switches:.2f}", each)
    return table


SECTIONS = {
    "scipy": against_scipy,
    "suite": suite,
    "learners": against_learners,
    "neighbors": neighbors,
    "growth": growth,
    "instances": instances,
    "overlaps": overlaps,
    "threads": thread_scaling,
    "batch": batch,
    "runs": whole_runs,
    "masks": masks,
    "cameras": cameras,
    "ground": ground,
    "drives": drives,
    "long-drives": long_drives,
}


def _table(title: str, headings: list[str], caption: str) -> Table:
    table = Table(title=title, caption=caption)
    table.add_column(headings[0])
    for heading in headings[1:]:
        table.add_column(heading, justify="right")
    return table


def _add_ratio(table: Table, name: str, peer: float, own: float) -> None:
    ratio = peer / own if own > 0 else np.inf
    table.add_row(name, f"{peer * 1e3:.1f}", f"{own * 1e3:.2f}", f"{ratio:.1f} x")


if __name__ == "__main__":
    main()
