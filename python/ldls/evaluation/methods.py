"""Ways from masks to instance labels of points, to be compared with one another (the paper's Table III, and others).

All yield (N,) int32 labels as `ldls.segment` does: -1 out of view, 0 background, m the instance of masks[m - 1].
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ldls import stages
from ldls.checks import checked
from ldls.evaluation.bound import bound_labels
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.clusters import best_clusters, largest_clusters, linked
from ldls.evaluation.on_masks import points_on_masks
from ldls.labeling import Labeling
from ldls.segmentation import Segmentation

OFF_GROUND_M = 0.2
"""Height from which on points are clustered; lower ones would join all that stands on the ground."""

DIRECT_PROJECTION = "direct projection"
CLUSTERING = "project + DBSCAN"
IN_MASKS = "clusters in the mask"
ENSEMBLE = "cluster ensemble"
DIFFUSION = "diffusion, no outlier removal"
PAPER = "the paper's method"
FULL = "ldls"
BOUND = "bound"


@checked
def compare(
    full: Segmentation, paper: Segmentation, truth: Labeling, classes: ClassSet
) -> Mapping[str, NDArray[np.int32]]:
    """Labels (N,) of every method by its name: simple ones, the paper's, ours, and what the masks allow.

    Args:
        full: Result of `ldls`, with one camera.
        paper: Result of the paper's method for the same frame.
        truth: True labels, for the bound.
        classes: The scored classes, for the bound.
    """
    direct, points = full.direct_labels, full.points
    heights = stages.ground(points[full.in_view], full.views[0].view.camera, threads=full.params.threads)
    standing = np.ones(len(direct), bool)
    # where no ground is found heights are NaN, and everything stands
    standing[full.in_view[heights < OFF_GROUND_M]] = False
    seen = np.flatnonzero(standing & (direct >= 0))
    ensemble = np.minimum(direct, 0)
    ensemble[seen] = best_clusters(points[seen], points_on_masks(full)[seen])
    return {
        DIRECT_PROJECTION: direct,
        CLUSTERING: largest_clusters(points, direct),
        IN_MASKS: largest_clusters(points, np.where(standing, direct, np.minimum(direct, 0)), linked),
        ENSEMBLE: ensemble,
        DIFFUSION: paper.diffused_labels,
        PAPER: paper.labels,
        FULL: full.labels,
        BOUND: bound_labels(full, truth, classes),
    }
