"""True labels in a recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Points, finite_rows
from ldls.errors import InputError
from ldls.labeling import Labeling
from ldls.segmentation import fit_upright_box
from ldls.viewing.recording import contexts
from ldls.viewing.recording.boxes import boxes_3d
from ldls.viewing.recording.cameras import POINT_PX
from ldls.viewing.recording.keeping import log_context
from ldls.viewing.recording.stream import Entity, rerun


def log_truth(entity: Entity, points: Points, truth: Labeling) -> None:
    """Log points (N, >= 3) by their true class, and a box around each true instance.

    Raises:
        InputError: There is not a label for each point.
    """
    if len(truth) != len(points):
        raise InputError(f"truth: {len(truth):,} labels, {len(points):,} points; expected one label a point")
    rr = rerun()
    rows = finite_rows(points)
    colours = np.array(contexts.truth_colours(truth), np.uint8)
    log_context(entity, contexts.of_truth(truth))
    entity.log(
        rr.Points3D(
            points[rows, :3].astype(np.float32),
            colors=colours[truth.classes[rows]],
            class_ids=truth.classes[rows].astype(np.uint16),
            radii=rr.Radius.ui_points(POINT_PX),
            show_labels=False,
        )
    )
    _log_boxes(entity / "boxes", points, truth, rows, colours)


def _log_boxes(
    entity: Entity, points: Points, truth: Labeling, finite: NDArray[np.int64], colours: NDArray[np.uint8]
) -> None:
    rows = finite[(truth.instances[finite] > 0) & (truth.classes[finite] > 0)]
    names = np.stack([truth.classes[rows], truth.instances[rows]])
    pairs, owner = np.unique(names, axis=1, return_inverse=True)
    xyz = points[rows, :3].astype(np.float64)
    classes = pairs[0]
    entity.log(
        boxes_3d(
            [fit_upright_box(xyz[owner.ravel() == at]) for at in range(pairs.shape[1])],
            labels=[f"{truth.names[of_class]} {instance}" for of_class, instance in pairs.T.tolist()],
            colours=colours[classes],
            class_ids=classes.astype(np.uint16),
        )
    )
