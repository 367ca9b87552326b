"""A ring of six cameras: the nuScenes frame with masks of its boxes, or a simulated one."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path

from rich.table import Table

import ldls
from benches.frames import Frame
from benches.measuring import medians, new_table
from ldls.categories import COCO_NAMES, category_ids
from ldls.cloud import Points


def ring() -> tuple[str, Points, list[ldls.View]]:
    """Name, points and views."""
    folder = os.environ.get("LDLS_TEST_DATA")
    return _nuscenes(Path(folder) / "nuscenes") if folder else _simulated()


def _nuscenes(folder: Path) -> tuple[str, Points, list[ldls.View]]:
    from ldls.datasets import open_source, read_boxes_2d

    (frame,) = open_source(folder)
    boxes = read_boxes_2d(folder)
    categories = sorted({box.category for found in boxes.values() for box in found})
    ids, names = category_ids(dict(enumerate(categories)))
    views = []
    for image in frame.images:
        found = boxes[image.name]
        assert image.camera.image_size is not None
        masks = ldls.InstanceMasks.from_boxes(
            [box.ltrb_px for box in found],
            image.camera.image_size,
            categories=[ids[categories.index(box.category)] for box in found],
            names=COCO_NAMES | names,
        )
        views.append(ldls.View(masks, image.camera, image.name))
    return "nuScenes frame, masks from 2D boxes", frame.points, views


def _simulated() -> tuple[str, Points, list[ldls.View]]:
    from ldls.simulation import make_rig, scene_frame

    frame = scene_frame(0, rig=make_rig(lidar="hdl-32e", camera="ring"))
    views = [ldls.View(image.masks, image.camera, image.name) for image in frame.images]
    return "simulated street, ring of six", frame.points, views


def cameras(_measured: Frame, options: argparse.Namespace) -> Table:
    """A ring of six cameras against each of them alone, by the time a point in view takes."""
    name, points, views = ring()
    params = ldls.Params(threads=options.threads)

    def run(some: list[ldls.View]) -> Callable[[], ldls.Segmentation]:
        return lambda: ldls.segment(points, some, params=params)

    sides = {view.name: run([view]) for view in views} | {"ring": run(views)}
    found = medians(sides, runs=options.runs)
    in_view = {side: len(call().in_view) for side, call in sides.items()}
    alone = sum(found[view.name] for view in views) / sum(in_view[view.name] for view in views)
    table = new_table(
        name,
        ["cameras", "points in view", "ms", "us a point", "over the six alone"],
        f"{options.threads} threads; the six alone take {alone * 1e6:.2f} us a point and camera",
    )
    for side, seconds in found.items():
        each = seconds / in_view[side]
        table.add_row(side, f"{in_view[side]:,}", f"{seconds * 1e3:.1f}", f"{each * 1e6:.2f}", f"{each / alone:.2f} x")
    return table
