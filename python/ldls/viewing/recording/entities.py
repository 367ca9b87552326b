"""A segmentation, or a frame as it was read, in a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Points, finite_rows
from ldls.datasets import Frame
from ldls.errors import InputError
from ldls.labeling import Labeling
from ldls.palette import category_colour, label_colours
from ldls.segmentation import OrientedBox, Segmentation, SegmentedObject, fit_upright_box
from ldls.stages import project
from ldls.view import camera_names
from ldls.viewing.depth import depth_colours, depths_m
from ldls.viewing.object_tables import markdown
from ldls.viewing.recording.cameras import log_camera, log_image, log_masks, log_pixels
from ldls.viewing.recording.contexts import Names, fields_of_points, log_truth_context
from ldls.viewing.recording.stream import Entity, rerun
from ldls.viewing.shown import names_of

POINT_PX = 1.5
BACKGROUND_POINT_PX = 0.5
"""Points without an object are small on an image, which they would hide."""


def log_result(
    root: Entity,
    names: Names,
    result: Segmentation,
    *,
    images: Mapping[str, NDArray[np.uint8]],
    truth: Labeling | None,
    title: str,
) -> None:
    """Log a segmentation below `root`, where `names` are given, as `Recording.log_result` says."""
    cameras = camera_names(result.views)
    for name in images:
        if name not in cameras:
            raise InputError(f"images: there is no camera {name!r}, expected {', '.join(cameras)}")
    result = names.add(result)
    root.log(rerun().ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    names.log(root, names.of_points)
    finite, seen_by_any = finite_rows(result.points), result.in_view
    log_points(root / "points", result.points[finite], **fields_of_points(result, result.labels[finite]))
    direct = fields_of_points(result, result.direct_labels[seen_by_any])
    log_points(root / "points" / "direct", result.points[seen_by_any], **direct)
    _log_object_boxes(root / "boxes", result)
    if truth is not None:
        _log_truth(root / "truth", result.points, truth)
    for camera, seen in zip(cameras, result.views, strict=True):
        place = root / "camera" / camera
        size = seen.view.masks.image_size
        log_camera(place, seen.view.camera, size)
        if camera in images:
            log_image(place / "image", images[camera], size)
        masks = place / "image" / "masks"
        names.log(masks, names.of_masks)
        log_masks(masks, seen, names.mask_ids(result))
        labels = result.labels[seen.in_view]
        radii = rerun().Radius.ui_points(np.where(labels > 0, POINT_PX, BACKGROUND_POINT_PX))
        own = fields_of_points(result, labels)
        log_pixels(place / "image" / "points", seen.pixels, radii=radii, show_labels=False, **own)
    (root / "objects").log(rerun().TextDocument(markdown(result, title=title), media_type="text/markdown"))
    _log_statistics(root / "statistics", result)


def log_frame(root: Entity, frame: Frame) -> None:
    """Log a frame without masks below `root`, as `Recording.log_frame` says."""
    rr = rerun()
    radius = rr.Radius.ui_points(POINT_PX)
    root.log(rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    xyz = frame.points[finite_rows(frame.points), :3].astype(np.float32)
    distance_m = np.linalg.norm(xyz.astype(np.float64), axis=1)
    (root / "points").log(rr.Points3D(xyz, colors=depth_colours(distance_m), radii=radius))
    if frame.truth is not None:
        _log_truth(root / "truth", frame.points, frame.truth)
    for image in frame.images:
        place = root / "camera" / image.name
        pixels = image.read()
        size = (pixels.shape[0], pixels.shape[1])
        log_camera(place, image.camera, size)
        log_image(place / "image", pixels, size)
        in_view, uv_px = project(frame.points, image.camera, image_size=size)
        colours = depth_colours(depths_m(frame.points[in_view], image.camera))
        log_pixels(place / "image" / "points", uv_px, colors=colours, radii=radius)


def log_points(entity: Entity, points: Points, **fields: NDArray[Any]) -> None:
    """Log points (n, >= 3), and their colours, class ids and the like as `rerun.Points3D` has them."""
    rr = rerun()
    xyz, radius = points[:, :3].astype(np.float32), rr.Radius.ui_points(POINT_PX)
    entity.log(rr.Points3D(xyz, radii=radius, show_labels=False, **fields))


def _log_truth(entity: Entity, points: Points, truth: Labeling) -> None:
    """Log points (N, >= 3) by their true class, and a box around each true instance."""
    if len(truth) != len(points):
        raise InputError(f"truth: {len(truth):,} labels, {len(points):,} points; expected one label a point")
    colours = log_truth_context(entity, truth)
    rows = finite_rows(points)
    classes = truth.classes[rows].astype(np.uint16)
    log_points(entity, points[rows], colors=colours[classes], class_ids=classes)
    rows = rows[(truth.instances[rows] > 0) & (truth.classes[rows] > 0)]
    pairs, owner = np.unique([truth.classes[rows], truth.instances[rows]], axis=1, return_inverse=True)
    xyz = points[rows, :3].astype(np.float64)
    _log_boxes(
        entity / "boxes",
        [fit_upright_box(xyz[owner.ravel() == at]) for at in range(pairs.shape[1])],
        labels=[f"{truth.names[of_class]} {instance}" for of_class, instance in pairs.T.tolist()],
        colors=colours[pairs[0]],
        class_ids=pairs[0].astype(np.uint16),
    )


def _log_object_boxes(entity: Entity, result: Segmentation) -> None:
    names = names_of(result)
    boxed = [(each, each.box) for each in result.objects if each.box is not None]
    _log_boxes(
        entity,
        [box for _, box in boxed],
        labels=[names[each.label - 1] + _speed(each) for each, _ in boxed],
        colors=label_colours(result.instances)[np.array([each.label for each, _ in boxed], np.int32)],
        class_ids=np.array([each.category for each, _ in boxed], np.uint16),
    )


def _speed(each: SegmentedObject) -> str:
    """Speed of an object that moves, to stand after its name."""
    return f", {hypot(*each.velocity):.1f} m/s" if any(each.velocity) else ""


def _log_boxes(entity: Entity, boxes: Sequence[OrientedBox], **fields: Any) -> None:  # noqa: ANN401
    """Log upright boxes; none, where there are none, take the place of earlier ones."""
    half_yaws = np.array([box.yaw / 2 for box in boxes])
    upright = np.zeros_like(half_yaws)
    entity.log(
        rerun().Boxes3D(
            centers=np.array([box.center for box in boxes]).reshape(-1, 3),
            half_sizes=np.array([box.size for box in boxes]).reshape(-1, 3) / 2,
            quaternions=np.stack([upright, upright, np.sin(half_yaws), np.cos(half_yaws)], axis=1),  # x y z w
            show_labels=True,
            fill_mode="MajorWireframe",
            **fields,
        )
    )


def _log_statistics(entity: Entity, result: Segmentation) -> None:
    """Log points of each category that has masks, mean confidence of labelled points, milliseconds of each stage."""
    rr = rerun()
    colours = {each.name: category_colour(each.category) for each in result.objects}
    counts: Counter[str] = Counter()
    for each in result.objects:
        counts[each.name] += each.n_points
    for name, count in counts.items():
        (entity / "points" / name).log(rr.Scalars(count), rr.SeriesLines(names=name, colors=colours[name]))
    labelled = result.labels > 0
    if labelled.any():
        mean = float(result.confidence[labelled].mean(dtype=np.float64))
        (entity / "confidence").log(rr.Scalars(mean), rr.SeriesLines(names="mean confidence"))
    for stage, seconds in result.timings.items():
        (entity / "milliseconds" / stage).log(rr.Scalars(seconds * 1e3), rr.SeriesLines(names=stage))
