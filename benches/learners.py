"""Peers from scikit-learn: DBSCAN within each mask, and LabelSpreading."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from sklearn.exceptions import ConvergenceWarning
from sklearn.semi_supervised import LabelSpreading

import ldls
from benches.frames import Frame
from benches.measuring import add_ratio, medians, new_table
from benches.scipy_pipeline import project
from ldls.evaluation.clusters import largest_clusters


def project_and_cluster(frame: Frame, masks: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Direct projection, and of the points of each mask the largest cluster that DBSCAN finds: the usual shortcut."""
    xyz, pixels = project(frame, masks.shape[1:])
    labels = np.zeros(len(xyz), np.int64)
    for m, mask in enumerate(masks, start=1):
        inside = np.flatnonzero(mask[pixels[:, 1], pixels[:, 0]])
        labels[inside[largest_clusters(xyz[inside], np.ones(len(inside), np.int32)) > 0]] = m
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


def against_learners(measured: Frame, options: argparse.Namespace) -> Table:
    """`ldls.segment` against project + DBSCAN and against label spreading."""
    dense, params = measured.masks.to_array(), ldls.Params(threads=options.threads)
    peers: dict[str, tuple[Callable[..., object], int]] = {
        "project + DBSCAN (scikit-learn)": (project_and_cluster, options.runs),
        "LabelSpreading (scikit-learn), 200 iterations": (spread_labels, min(options.runs, 3)),
    }
    table = new_table(
        f"{measured.name}: the whole frame",
        ["peer", "peer, ms", "ldls, ms", "ratio"],
        f"{options.threads} threads on both sides",
    )
    own = partial(ldls.segment, measured.points, measured.masks, measured.camera, params=params)
    for name, (peer, rounds) in peers.items():
        found = medians({"peer": partial(peer, measured, dense), "ldls": own}, runs=rounds)
        add_ratio(table, name, found["peer"], found["ldls"])
    return table
