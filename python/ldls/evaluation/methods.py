"""Ways from masks to instance labels of points, to be compared with one another (the paper's Table III, and one more).

All take points (N, >= 3) in metres in the lidar frame, instance masks and a camera, and yield (N,) int32 labels as
`ldls.segment` does: -1 out of view, 0 background, m the instance of masks[m - 1].
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls import stages
from ldls._optional import require
from ldls.camera import Camera
from ldls.cloud import as_points
from ldls.label_diffusion import segment
from ldls.masks import InstanceMasks
from ldls.params import Params

OUT_OF_VIEW = -1
DBSCAN_RADIUS_M = 0.5
"""Distance up to which two points belong to one cluster: what users of the shortcut choose for cars and people."""
DBSCAN_MIN_POINTS = 5

DIRECT_PROJECTION = "direct projection"
CLUSTERING = "project + DBSCAN"
DIFFUSION = "diffusion, no outlier removal"
FULL = "ldls"


def direct_projection(points: ArrayLike, masks: InstanceMasks, camera: Camera) -> NDArray[np.int32]:
    """Labels (N,): each point takes that of the pixel nearest to it; of several masks, the first."""
    rows, pixels = stages.project(points, camera, image_size=masks.image_size)
    labels = np.full(len(as_points(points)), OUT_OF_VIEW, np.int32)
    labels[rows] = stages.direct_labels(pixels, masks)
    return labels


def largest_clusters(points: ArrayLike, labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Labels (N,) with every point outside the largest DBSCAN cluster of its instance turned into background."""
    cluster = require("sklearn.cluster", "eval")
    xyz, kept = as_points(points)[:, :3], labels.copy()
    for label in np.unique(labels[labels > 0]):
        members = np.flatnonzero(labels == label)
        model = cluster.DBSCAN(eps=DBSCAN_RADIUS_M, min_samples=DBSCAN_MIN_POINTS)
        clusters = model.fit_predict(xyz[members])
        counts = np.bincount(clusters + 1)[1:]  # the first are those in no cluster
        largest = counts.argmax() if len(counts) else None
        kept[members[clusters != largest]] = 0
    return kept


def compare(
    points: ArrayLike, masks: InstanceMasks, camera: Camera, *, params: Params | None = None
) -> Mapping[str, NDArray[np.int32]]:
    """Labels (N,) of every method by its name, in the order of the paper's ablation."""
    direct = direct_projection(points, masks, camera)
    full = segment(points, masks, camera, params=params)
    return {
        DIRECT_PROJECTION: direct,
        CLUSTERING: largest_clusters(points, direct),
        DIFFUSION: full.diffused_labels,
        FULL: full.labels,
    }
