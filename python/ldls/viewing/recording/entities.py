"""A segmentation in a recording."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import finite_rows
from ldls.errors import InputError
from ldls.labeling import Labeling
from ldls.segmentation import Segmentation
from ldls.view import camera_names
from ldls.viewing.recording.boxes import boxes_3d
from ldls.viewing.recording.cameras import POINT_PX, log_camera, log_image, log_masks, log_pixels
from ldls.viewing.recording.colours import check_ids, class_ids, keypoint_ids, label_colours
from ldls.viewing.recording.contexts import log_names
from ldls.viewing.recording.keeping import log_context
from ldls.viewing.recording.statistics import log_statistics
from ldls.viewing.recording.stream import Entity, rerun
from ldls.viewing.recording.tables import markdown
from ldls.viewing.recording.truth import log_truth


def log(
    result: Segmentation,
    *,
    images: Mapping[str, NDArray[np.uint8]] | None = None,
    truth: Labeling | None = None,
    name: str = "",
    entity: str = "world",
    recording: Any = None,  # noqa: ANN401
) -> None:
    """Log a segmentation at the time that is set; the module's docstring says which entities it makes.

    What an earlier call logged and this one has not, as a truth, stays until `rerun.Clear` takes it away.

    Args:
        result: The segmentation.
        images: (H, W, 3) uint8 RGB images by the names of the views; those without one are "camera 0", "camera 1" ...
        truth: True labels of the points.
        name: Title of the table of objects.
        entity: Where all goes.
        recording: A `rerun.RecordingStream`; the active one by default.

    Raises:
        InputError: No recording is active, or an image has no camera or another size than its masks.
        LimitError: A category id is greater than Rerun's ids.
        ImportError: The extra `viz` is not installed.
    """
    root = Entity(entity, recording)
    check_ids(result)
    _check_images(images or {}, camera_names(result.views))
    root.log(rerun().ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    names, new = log_names(root, result)
    _log_points(root, result)
    _log_boxes(root / "boxes", result)
    if truth is not None:
        log_truth(root / "truth", result.points, truth)
    for camera, seen in zip(camera_names(result.views), result.views, strict=True):
        place = root / "camera" / camera
        size = seen.view.masks.image_size
        log_camera(place, seen.view.camera, size)
        if images is not None and camera in images:
            log_image(place / "image", images[camera], size)
        masks = place / "image" / "masks"
        if new:
            log_context(masks, names.of_masks())
        log_masks(masks, seen, names.mask_ids(result))
        log_pixels(place / "image" / "points", seen, result)
    text = markdown(result, title=name)
    (root / "objects").log(rerun().TextDocument(text, media_type="text/markdown"))
    log_statistics(root / "statistics", result)


def _log_points(root: Entity, result: Segmentation) -> None:
    finite = finite_rows(result.points)
    _log_labelled(root / "points", result, finite, result.labels[finite])
    _log_labelled(root / "points" / "direct", result, result.in_view, result.direct_labels[result.in_view])


def _log_labelled(entity: Entity, result: Segmentation, rows: NDArray[np.int64], labels: NDArray[np.int32]) -> None:
    rr = rerun()
    categories = np.array([0, *(instance.category for instance in result.instances), 0], np.int32)
    entity.log(
        rr.Points3D(
            result.points[rows, :3].astype(np.float32),
            colors=label_colours(result)[labels],
            class_ids=class_ids(categories[labels]),
            keypoint_ids=keypoint_ids(labels),
            radii=rr.Radius.ui_points(POINT_PX),
            show_labels=False,
        )
    )


def _log_boxes(entity: Entity, result: Segmentation) -> None:
    found = [(o, o.box) for o in result.objects if o.box is not None]
    labels = np.array([o.label for o, _ in found], np.int32)
    entity.log(
        boxes_3d(
            [box for _, box in found],
            labels=[f"{o.name} {o.label}" for o, _ in found],
            colours=label_colours(result)[labels],
            class_ids=class_ids(np.array([o.category for o, _ in found], np.int32)),
        )
    )


def _check_images(images: Mapping[str, NDArray[np.uint8]], names: tuple[str, ...]) -> None:
    for name in images:
        if name not in names:
            raise InputError(f"images: there is no camera {name!r}, expected {', '.join(names)}")
