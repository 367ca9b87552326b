"""Peers from scikit-learn: DBSCAN within each mask, and LabelSpreading."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import DBSCAN
from sklearn.exceptions import ConvergenceWarning
from sklearn.semi_supervised import LabelSpreading

from benches.frames import Frame
from benches.scipy_pipeline import project
from ldls.evaluation.clusters import DBSCAN_MIN_POINTS, DBSCAN_RADIUS_M


def project_and_cluster(frame: Frame, masks: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Direct projection, and of the points of each mask the largest cluster that DBSCAN finds: the usual shortcut."""
    xyz, pixels = project(frame, masks.shape[1:])
    labels = np.zeros(len(xyz), np.int64)
    for m, mask in enumerate(masks, start=1):
        inside = np.flatnonzero(mask[pixels[:, 1], pixels[:, 0]])
        if len(inside) == 0:
            continue
        clusters = DBSCAN(eps=DBSCAN_RADIUS_M, min_samples=DBSCAN_MIN_POINTS).fit_predict(xyz[inside])
        if (clusters >= 0).any():
            labels[inside[clusters == np.bincount(clusters[clusters >= 0]).argmax()]] = m
    return labels


def spread_labels(frame: Frame, masks: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Direct projection, then 200 iterations of scikit-learn's label spreading over ten neighbours."""
    xyz, pixels = project(frame, masks.shape[1:])
    direct = np.zeros(len(xyz), np.int64)
    for m in range(len(masks), 0, -1):
        direct[masks[m - 1][pixels[:, 1], pixels[:, 0]]] = m
    model = LabelSpreading(kernel="knn", n_neighbors=10, max_iter=200, tol=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # 200 iterations are what is compared
        return np.asarray(model.fit(xyz, direct).transduction_)
