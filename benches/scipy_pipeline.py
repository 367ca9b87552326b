"""The plain peer: the method in float64 with NumPy and SciPy, as one would write it at first."""

from __future__ import annotations

import argparse
import statistics
import time
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

import ldls
from benches.frames import Frame
from benches.measuring import add_ratio, medians, new_table
from ldls import Params

STAGES = ("project", "pixel_labels", "neighbors", "graph", "diffusion", "components")


def segment(frame: Frame, params: Params, dense_masks: NDArray[np.bool_]) -> tuple[NDArray[np.int64], dict[str, float]]:
    """Labels of the points in view, and seconds a stage. Dense masks are made beforehand and cost nothing here."""
    laps = [time.perf_counter()]
    xyz, pixels = project(frame, dense_masks.shape[1:])
    laps.append(time.perf_counter())
    counts, mass = _pixel_labels(pixels, dense_masks, params)
    laps.append(time.perf_counter())
    distances, indices = cKDTree(xyz).query(xyz, params.neighbors + 1, workers=1)
    laps.append(time.perf_counter())
    A, b = _graph(distances, indices, counts, mass, params.sigma)
    laps.append(time.perf_counter())
    z = np.zeros_like(b)
    for _ in range(params.iterations or 0):
        z = A @ z + b
    labels = z.argmax(axis=1)
    laps.append(time.perf_counter())
    labels = _largest_components(A, labels)
    laps.append(time.perf_counter())
    return labels, dict(zip(STAGES, np.diff(laps).tolist(), strict=True))


def project(frame: Frame, image_size: tuple[int, ...]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(n, 3) points in view and their pixels (n, 2), column and row."""
    matrix = frame.camera.projection @ frame.camera.T_camera_lidar
    xyz = frame.points[:, :3].astype(np.float64)
    u, v, depth = matrix[:, :3] @ xyz.T + matrix[:, 3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = np.floor(u / depth + 0.5), np.floor(v / depth + 0.5)
    height, width = image_size
    seen = (depth > frame.camera.min_depth_m) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return xyz[seen], np.stack([column[seen], row[seen]], axis=1).astype(np.int64)


def _pixel_labels(
    pixels: NDArray[np.int64], masks: NDArray[np.bool_], params: Params
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pixel weights by label through summed-area tables, one a label."""
    layers = np.concatenate([~masks.any(axis=0, keepdims=True), masks])
    sums = np.zeros((len(layers), layers.shape[1] + 1, layers.shape[2] + 1))
    sums[:, 1:, 1:] = layers.cumsum(axis=1).cumsum(axis=2)
    reach = params.window // 2
    column, row = pixels.T
    left, right = np.maximum(column - reach, 0), np.minimum(column + reach + 1, layers.shape[2])
    top, bottom = np.maximum(row - reach, 0), np.minimum(row + reach + 1, layers.shape[1])
    counts = sums[:, bottom, right] - sums[:, top, right] - sums[:, bottom, left] + sums[:, top, left]
    return params.pixel_weight * counts.T, params.pixel_weight * (right - left) * (bottom - top)


def _graph(
    distances: NDArray[np.float64],
    indices: NDArray[np.int64],
    counts: NDArray[np.float64],
    mass: NDArray[np.float64],
    sigma: float,
) -> tuple[csr_array, NDArray[np.float64]]:
    n, degree = indices.shape
    rows = np.repeat(np.arange(n), degree)
    weights = np.exp(-(distances**2) / sigma)
    edges = coo_array((weights.ravel(), (rows, indices.ravel())), shape=(n, n)).tocsr()
    row_sums = edges.sum(axis=1) + mass
    return diags_array(1 / row_sums, shape=(n, n)) @ edges, np.ascontiguousarray(counts / row_sums[:, None])


def _largest_components(edges: csr_array, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    kept = np.zeros_like(labels)
    for m in range(1, labels.max(initial=0) + 1):
        members = np.flatnonzero(labels == m)
        if len(members):
            _, component = connected_components(edges[members][:, members], directed=False)
            kept[members[component == np.bincount(component).argmax()]] = m
    return kept


def against_scipy(measured: Frame, options: argparse.Namespace) -> Table:
    """Each stage of the paper's method and `ldls.segment` against the plain SciPy pipeline."""
    params, best = ldls.Params.paper(threads=options.threads), ldls.Params(threads=options.threads)
    dense = measured.masks.to_array()
    stages: dict[str, list[dict[str, float]]] = {"scipy": [], "ldls": []}
    labels = {}

    def run_scipy() -> None:
        labels["scipy"], seconds = segment(measured, params, dense)
        stages["scipy"].append(seconds)

    def run_ldls() -> None:
        result = ldls.segment(measured.points, measured.masks, measured.camera, params=params)
        labels["ldls"] = result.labels[result.in_view]
        stages["ldls"].append(dict(result.timings))

    run_best = partial(ldls.segment, measured.points, measured.masks, measured.camera, params=best)
    whole = medians({"scipy": run_scipy, "ldls": run_ldls, "best": run_best}, runs=options.runs)
    differ = int((labels["scipy"] != labels["ldls"]).sum())
    table = new_table(
        f"{measured.name}: {len(labels['ldls']):,} points in view, {len(measured.masks)} instances",
        ["stage", "plain scipy float64, ms", "ldls, ms", "ratio"],
        f"medians of {options.runs} runs, ldls on {options.threads} threads; labels that differ: {differ}",
    )
    for stage in STAGES:
        peer, own = (statistics.median(run[stage] for run in stages[side][1:]) for side in ("scipy", "ldls"))
        add_ratio(table, stage, peer, own)
    table.add_section()
    add_ratio(table, "ldls.segment, the paper's method", whole["scipy"], whole["ldls"])
    add_ratio(table, "ldls.segment, the defaults", whole["scipy"], whole["best"])
    return table
