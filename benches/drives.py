"""Simulated drives: labels of windows of sweeps against those of each sweep alone, with the errors of the suite."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.progress import track
from scipy.spatial.transform import Rotation

import ldls
from ldls.datasets import open_source
from ldls.evaluation import ClassSet, Evaluation, Pair, TrackingScores, evaluate
from ldls.labeling import Labeling
from ldls.simulation import Drive, drive_folder, suite_folder, write_drive
from ldls.simulation.production import SUITE_SEGMENTER, SUITE_SENSORS

FIRST_SEED = 4000
KINDS = ("street", "campus")
CLASSES = ("Car", "Pedestrian")

OFF_M, OFF_DEG, OFF_S = 0.05, 0.3, 0.05
"""What wrong poses are off by."""

Window = Sequence[tuple[ldls.Sweep, Labeling]]


def drives(lidar: str, count: int, n_frames: int = 20) -> Iterator[list[tuple[ldls.Sweep, Labeling]]]:
    """The sweeps of `count` drives and their truth, from files, which are made first where they are not there yet."""
    folder = suite_folder().parent / "drives"
    for seed in track(range(FIRST_SEED, FIRST_SEED + count), description=f"drives of {lidar}"):
        errors = {"segmenter": SUITE_SEGMENTER, "sensors": SUITE_SENSORS}
        drive = Drive(n_frames=n_frames, seed=seed, kind=KINDS[seed % 2], lidar=lidar, **errors)  # type: ignore[arg-type]
        for _ in write_drive(folder / lidar, drive, processes=2):
            pass
        yield list(_sweeps(drive_folder(folder / lidar, drive)))


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


def scores(of_drives: Sequence[Window], size: int, threads: int) -> tuple[Evaluation, TrackingScores, float]:
    """Scores of windows of so many sweeps before tracking, those of tracks over all drives, and seconds a sweep."""
    params, seconds, n_sweeps, pairs = ldls.Params(threads=threads), 0.0, 0, []
    classes = ClassSet.kitti(CLASSES)
    tracking = TrackingScores(CLASSES)
    for number, drive in enumerate(of_drives):
        tracker, own = ldls.Tracker(), []
        for first in range(0, len(drive), size):
            window = drive[first : first + size]
            sweeps = [sweep for sweep, _ in window]
            start = time.perf_counter()
            results = ldls.segment_sweeps(sweeps, params=params)
            seconds += time.perf_counter() - start
            tracked = tracker.track(sweeps, results)
            for at, (result, numbered, (_, truth)) in enumerate(zip(results, tracked, window, strict=True)):
                pairs.append(Pair(f"{number} {first + at}", _labeling(result), truth))
                own.append(Pair(f"{number} {first + at}", _labeling(numbered), truth))
        n_sweeps += len(drive)
        of_drive = evaluate(own, classes=classes, track=True).tracking
        assert of_drive is not None
        tracking.merge(of_drive)
    return evaluate(pairs, classes=classes), tracking, seconds / n_sweeps


def _labeling(result: ldls.Segmentation) -> Labeling:
    """Labels, with tracks for instances where there are some; truth says which points count."""
    names = [instance.name for instance in result.instances]
    return Labeling.from_instance_labels(np.maximum(result.labels, 0), names, instance_ids=result.instance_ids[1:])
