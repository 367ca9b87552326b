"""A ring of six cameras: the nuScenes frame with masks of its boxes, or a simulated one."""

from __future__ import annotations

import os
from pathlib import Path

import ldls
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
