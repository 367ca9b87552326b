"""Instances made of clusters of points: what many do instead of diffusing labels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls._optional import require
from ldls.checks import checked
from ldls.cloud import as_points
from ldls.evaluation.on_masks import overlaps_with_masks

if TYPE_CHECKING:
    from scipy.sparse import csr_array

DBSCAN_RADIUS_M = 0.5
"""Distance up to which two points belong to one cluster: what users of the shortcut choose for cars and people."""
DBSCAN_MIN_POINTS = 5
RADII_M = (1.2, 0.8, 0.5, 0.3)
"""The same distances for clusters of points off the ground, from those that join the most points."""
CHUNK = 256
"""Points whose pairs are held at a time: near the sensor a point has thousands of others within 1.2 m."""

Clusterer = Callable[[NDArray[np.floating]], NDArray[np.intp]]
"""Number of the cluster of each of (n, 3) points in metres; -1 for none."""


def dbscan(points: NDArray[np.floating]) -> NDArray[np.intp]:
    """Number (n,) of the DBSCAN cluster of each point, 0.5 m and 5 points; -1 for none."""
    cluster = require("sklearn.cluster", "eval")
    found: NDArray[np.intp] = cluster.DBSCAN(eps=DBSCAN_RADIUS_M, min_samples=DBSCAN_MIN_POINTS).fit_predict(points)
    return found


def linked(points: NDArray[np.floating], radius_m: float = RADII_M[0]) -> NDArray[np.intp]:
    """Number (n,) of the DBSCAN cluster of each point for 2 points within `radius_m`; -1 for none.

    With 2 points these are the connected components of the graph of all pairs so near, and need not be held whole.
    """
    spatial, sparse = require("scipy.spatial", "eval"), require("scipy.sparse", "eval")
    tree, found = spatial.KDTree(points), np.arange(len(points))
    for start in range(0, len(points), CHUNK):
        chunk = spatial.KDTree(points[start : start + CHUNK])
        pairs = chunk.sparse_distance_matrix(tree, radius_m, output_type="ndarray")
        ends = found[start + pairs["i"]], found[pairs["j"]]
        graph = sparse.coo_array((np.ones(len(pairs), np.int8), ends), shape=(len(points),) * 2)
        found = sparse.csgraph.connected_components(graph, directed=False)[1][found]
    numbers, sizes = np.unique(found, return_inverse=True, return_counts=True)[1:]
    return np.where(sizes[numbers] > 1, numbers, -1)


@checked
def largest_clusters(points: ArrayLike, labels: NDArray[np.int32], clusterer: Clusterer = dbscan) -> NDArray[np.int32]:
    """Labels (N,) with every point outside the largest cluster of its instance turned into background."""
    xyz, kept = as_points(points)[:, :3], labels.copy()
    for label in np.unique(labels[labels > 0]):
        members = np.flatnonzero(labels == label)
        clusters = clusterer(xyz[members])
        counts = np.bincount(clusters + 1)[1:]  # the first are those in no cluster
        largest = counts.argmax() if len(counts) else None
        kept[members[clusters != largest]] = 0
    return kept


@checked
def best_clusters(points: ArrayLike, on: csr_array) -> NDArray[np.int32]:
    """Labels (n,) by the clusters of all points that fit instances best.

    Points are clustered at each of `RADII_M`, as `linked` does. Of all these clusters an instance becomes the one of
    largest IoU with the points on its masks, of equals the one of the larger radius. Where two claim a point, the one
    that fits better has it, of equals the first.

    Args:
        points: (n, >= 3) points off the ground, in metres.
        on: (n, M) sparse, rows of `points_on_masks`.
    """
    xyz = as_points(points)[:, :3]
    clusters = [linked(xyz, radius_m) for radius_m in RADII_M]
    ious = [overlaps_with_masks(numbers, on) for numbers in clusters]
    fits = np.array([iou.max(axis=0, initial=0.0) for iou in ious])
    best = np.zeros(len(xyz), np.int32)
    for m in np.argsort(-fits.max(axis=0), kind="stable"):
        k = int(fits[:, m].argmax())
        if fits[k, m] > 0:
            best[(clusters[k] == ious[k][:, m].argmax()) & (best == 0)] = m + 1
    return best
