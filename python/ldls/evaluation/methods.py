"""Ways from masks to instance labels of points, to be compared with one another (the paper's Table III, and one more).

All yield (N,) int32 labels as `ldls.segment` does: -1 out of view, 0 background, m the instance of masks[m - 1].
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls._optional import require
from ldls.cloud import as_points
from ldls.segmentation import Segmentation

DBSCAN_RADIUS_M = 0.5
"""Distance up to which two points belong to one cluster: what users of the shortcut choose for cars and people."""
DBSCAN_MIN_POINTS = 5

DIRECT_PROJECTION = "direct projection"
CLUSTERING = "project + DBSCAN"
DIFFUSION = "diffusion, no outlier removal"
FULL = "ldls"


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


def compare(full: Segmentation) -> Mapping[str, NDArray[np.int32]]:
    """Labels (N,) of every method by its name, in the order of the paper's ablation.

    Args:
        full: Result of the full method.
    """
    return {
        DIRECT_PROJECTION: full.direct_labels,
        CLUSTERING: largest_clusters(full.points, full.direct_labels),
        DIFFUSION: full.diffused_labels,
        FULL: full.labels,
    }
