"""Simulated drives: labels of windows of sweeps against those of each sweep alone, with the errors of the suite."""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.progress import track
from rich.table import Table
from scipy.spatial.transform import Rotation

import ldls
from benches.frames import Frame
from benches.measuring import new_table
from ldls.datasets import open_source
from ldls.evaluation import ClassSet, Evaluation, Pair, TrackingScores, evaluate
from ldls.labeling import Labeling
from ldls.simulation import Drive, drive_folder, drive_frame, suite_folder, write_drive
from ldls.simulation.production import SUITE_SEGMENTER, SUITE_SENSORS

FIRST_SEED = 4000
FIRST_LONG_SEED = 3400
KINDS = ("street", "campus")
CLASSES = ("Car", "Pedestrian")

OFF_M, OFF_DEG, OFF_S = 0.05, 0.3, 0.05
"""What wrong poses are off by."""

LONG, MISSED, GAP = 200, 0.2, 10
"""Sweeps of a long drive, share of its masks that are left out, and sweeps in a row without any."""

Window = Sequence[tuple[ldls.Sweep, Labeling]]
Seconds = NDArray[np.float64]
"""Those of labelling and those of tracking."""


def drives(lidar: str, count: int) -> Iterator[Window]:
    """The sweeps of `count` drives and their truth."""
    for seed in track(range(FIRST_SEED, FIRST_SEED + count), description=f"drives of {lidar}"):
        yield list(_sweeps(_written(_drive(lidar, seed, n_frames=20))))


def long_drives(count: int) -> Iterator[tuple[Window, Window]]:
    """The sweeps of `count` long drives and their truth, and the same with cars that stand as the only objects."""
    seeds = range(FIRST_LONG_SEED, FIRST_LONG_SEED + count)
    for seed in track(seeds, description="long drives"):
        drive = _drive("vlp-16", seed, n_frames=LONG)
        whole = list(_sweeps(_written(drive)))
        numbered = enumerate(drive_frame(drive, 0).objects, start=1)
        stands = [number for number, thing in numbered if not any(thing.velocity_m_s)]
        yield whole, [(sweep, _only_cars(truth, stands)) for sweep, truth in whole]


def _drive(lidar: str, seed: int, n_frames: int) -> Drive:
    kind = KINDS[seed % 2]
    return Drive(n_frames=n_frames, seed=seed, kind=kind, lidar=lidar, segmenter=SUITE_SEGMENTER, sensors=SUITE_SENSORS)


def _written(drive: Drive) -> Path:
    """The folder of a drive, which is made first where it is not there yet."""
    folder = suite_folder().parent / "drives" / drive.lidar
    for _ in write_drive(folder, drive, processes=2):
        pass
    return drive_folder(folder, drive)


def _only_cars(truth: Labeling, numbers: Sequence[int]) -> Labeling:
    """The truth of the cars of these numbers; all else is background."""
    kept = np.isin(truth.instances, numbers) & (np.array(truth.names)[truth.classes] == "Car")
    return replace(truth, classes=np.where(kept, truth.classes, 0), instances=np.where(kept, truth.instances, 0))


def _sweeps(folder: Path) -> Iterator[tuple[ldls.Sweep, Labeling]]:
    for frame in open_source(folder):
        (image,) = frame.images
        masks = ldls.read_masks(folder / "masks_02" / f"{frame.name}.json")
        view = ldls.View(masks, image.camera)
        seen, _ = ldls.stages.project(frame.points, image.camera, image_size=masks.image_size)
        if frame.pose is None or frame.stamp is None or frame.truth is None:
            raise RuntimeError(f"{folder}: frame {frame.name} has no pose, stamp or truth")
        in_view = np.isin(np.arange(len(frame.points)), seen)
        yield ldls.Sweep(frame.points, [view], frame.pose, frame.stamp), frame.truth.restricted(in_view)


def with_masks_left_out(drive: Window, seed: int) -> Window:
    """The drive with its masks in random order, `MISSED` of them left out, and all of `GAP` sweeps in a row."""
    generator = np.random.default_rng(seed)
    blind = int(generator.integers(0, len(drive) - GAP))
    left = []
    for at, (sweep, truth) in enumerate(drive):
        (view,) = sweep.views
        missed = 1.0 if blind <= at < blind + GAP else MISSED
        kept = np.flatnonzero(generator.random(len(view.masks)) >= missed)
        masks = view.masks.select(generator.permutation(kept))
        left.append((replace(sweep, views=[replace(view, masks=masks)]), truth))
    return left


def with_wrong_poses(drive: Window, seed: int) -> Window:
    """The drive with poses of `OFF_S` too early or too late, and then `OFF_M` and `OFF_DEG` off, each another way."""
    generator = np.random.default_rng(seed)
    sweeps = [sweep for sweep, _ in drive]
    trajectory = ldls.Trajectory([sweep.stamp for sweep in sweeps], [sweep.pose for sweep in sweeps])
    wrong = []
    for sweep, truth in drive:
        off_s, shift, turn = generator.choice([-OFF_S, OFF_S]), generator.normal(size=3), generator.normal(size=3)
        off = np.eye(4)
        off[:3, :3] = Rotation.from_rotvec(np.deg2rad(OFF_DEG) * turn / np.linalg.norm(turn)).as_matrix()
        off[:3, 3] = OFF_M * shift / np.linalg.norm(shift)
        wrong.append((replace(sweep, pose=trajectory.at(sweep.stamp + off_s) @ off), truth))
    return wrong


def scores(of_drives: Sequence[Window], size: int, threads: int) -> tuple[Evaluation, TrackingScores, Seconds]:
    """Scores of windows of so many sweeps before tracking, those of tracks over all drives, and seconds a sweep."""
    seconds, n_sweeps, pairs = np.zeros(2), 0, []
    tracking = TrackingScores(CLASSES)
    for number, drive in enumerate(of_drives):
        results, tracked, of_drive = _tracked(drive, size, threads)
        seconds, n_sweeps = seconds + of_drive, n_sweeps + len(drive)
        for at, (result, (_, truth)) in enumerate(zip(results, drive, strict=True)):
            pairs.append(Pair(f"{number} {at}", _labeling(result), truth))
        tracking.merge(_tracking(tracked, drive))
    return evaluate(pairs, classes=ClassSet.kitti(CLASSES)), tracking, seconds / n_sweeps


def long_scores(drive: Window, standing: Window, size: int, seed: int, threads: int) -> tuple[TrackingScores, int]:
    """Scores of the tracks of a long drive of which masks are left out, and id switches of the cars that stand."""
    _, tracked, _ = _tracked(with_masks_left_out(drive, seed), size, threads)
    return _tracking(tracked, drive), _tracking(tracked, standing).total.id_switches


def _tracked(
    drive: Window, size: int, threads: int
) -> tuple[list[ldls.Segmentation], list[ldls.Segmentation], Seconds]:
    """What windows of so many sweeps are labelled, the same with tracks, and the seconds that they took."""
    params, tracker, seconds = ldls.Params(threads=threads), ldls.Tracker(), np.zeros(2)
    results: list[ldls.Segmentation] = []
    tracked: list[ldls.Segmentation] = []
    for first in range(0, len(drive), size):
        sweeps = [sweep for sweep, _ in drive[first : first + size]]
        laps = [time.perf_counter()]
        window = ldls.segment_sweeps(sweeps, params=params)
        laps.append(time.perf_counter())
        tracked += tracker.track(sweeps, window)
        seconds += np.diff([*laps, time.perf_counter()])
        results += window
    return results, tracked, seconds


def _tracking(tracked: Sequence[ldls.Segmentation], drive: Window) -> TrackingScores:
    rows = enumerate(zip(tracked, drive, strict=True))
    pairs = [Pair(f"{at}", _labeling(result), truth) for at, (result, (_, truth)) in rows]
    tracking = evaluate(pairs, classes=ClassSet.kitti(CLASSES), track=True).tracking
    assert tracking is not None
    return tracking


def _labeling(result: ldls.Segmentation) -> Labeling:
    """Labels, with tracks for instances where there are some; truth says which points count."""
    names = [instance.name for instance in result.instances]
    return Labeling.from_instance_labels(np.maximum(result.labels, 0), names, instance_ids=result.instance_ids[1:])


def errors_and_tracks(measured: Frame, options: argparse.Namespace) -> Table:
    """Errors, tracks and times of windows of sweeps against those of each sweep alone, on simulated drives."""
    table = new_table(
        f"drives of 20 sweeps, {options.drives} of each lidar",
        [
            "lidar",
            "sweeps together",
            "error car",
            "error person",
            "S_assoc",
            "switches a hundred",
            "ms a sweep",
            "its tracks",
        ],
        "error: 100 less the IoU of all points in view, in %; wrong poses: 5 cm and 0.3 degrees off, of a moment 50 ms "
        f"off; labels on {options.threads} threads, tracks on one",
    )
    for lidar in ("vlp-16", "hdl-64e"):
        of_lidar = list(drives(lidar, options.drives))
        off = [with_wrong_poses(drive, seed) for seed, drive in enumerate(of_lidar)]
        for together, size, of_drives in (("1", 1, of_lidar), ("5", 5, of_lidar), ("5, wrong poses", 5, off)):
            found, tracks, seconds = scores(of_drives, size, options.threads)
            errors = [f"{100 - 100 * (found.semantic[name].iou or 0.0):.1f}" for name in CLASSES]
            quality = tracks.total
            association = (f"{quality.s_assoc or 0.0:.2f}", f"{quality.switches_per_100 or 0.0:.2f}")
            table.add_row(lidar, together, *errors, *association, *(f"{1e3 * each:.1f}" for each in seconds))
    return table


def numbers(_measured: Frame, options: argparse.Namespace) -> Table:
    """Numbers of objects over drives of which masks are left out."""
    table = new_table(
        f"{options.drives} drives of {LONG} sweeps of a VLP-16, twice each",
        ["sweeps together", "S_assoc", "LSTQ", "switches a hundred", "switches of standing cars"],
        f"masks in random order, {MISSED:.0%} of them left out and all of {GAP} sweeps in a row; "
        "means of the drives, but switches of all object frames and of each drive",
    )
    of_lidar = list(long_drives(options.drives))
    for size in (1, 5):
        twice = itertools.product(of_lidar, range(2))
        found = [long_scores(*drive, size, seed, options.threads) for drive, seed in twice]
        tracks, of_standing = zip(*found, strict=True)
        totals = [of_drive.total for of_drive in tracks]
        association = statistics.mean(total.s_assoc or 0.0 for total in totals)
        quality = statistics.mean(of_drive.lstq or 0.0 for of_drive in tracks)
        switches = 100 * sum(t.id_switches for t in totals) / sum(t.object_frames for t in totals)
        each = " ".join(str(count) for count in of_standing)
        table.add_row(f"{size}", f"{association:.3f}", f"{quality:.3f}", f"{switches:.2f}", each)
    return table
