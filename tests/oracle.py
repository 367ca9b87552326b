"""The method as slow, plain float64 NumPy and SciPy, straight from its definition: what is right."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist


@dataclass
class Expected:
    in_view: np.ndarray
    pixels: np.ndarray
    diffused: np.ndarray
    labels: np.ndarray
    likelihood: np.ndarray
    edges: coo_array


def segment(points, masks, camera_matrix, params, *, min_depth_m=0.1):
    """`points` (N, 3), `masks` (M, H, W) bool, `camera_matrix` (3, 4) from lidar to homogeneous pixels."""
    in_view, pixels = project(points, camera_matrix, masks.shape[1:], min_depth_m)
    edges = point_edges(points[in_view].astype(np.float64), params.neighbors, params.sigma)
    labels, mass = pixel_edges(pixels, masks, params.window, params.pixel_weight)
    row_sums = edges.sum(axis=1) + mass
    A = diags_array(1 / row_sums, shape=edges.shape) @ edges
    b = labels / row_sums[:, None]
    z = np.zeros_like(b)
    for _ in range(params.iterations):
        z = A @ z + b
    diffused = z.argmax(axis=1) if len(z) else np.zeros(0, int)
    kept = largest_components(edges, diffused) if params.remove_outliers else diffused
    return Expected(in_view, pixels, diffused, kept, z, edges)


def project(points, camera_matrix, image_size, min_depth_m):
    xyz = points[:, :3].astype(np.float64)
    usable = np.isfinite(xyz).all(axis=1) & (xyz != 0).any(axis=1)
    rows = np.flatnonzero(usable)
    u, v, depth = camera_matrix @ np.hstack([xyz[rows], np.ones((len(rows), 1))]).T
    ahead = depth > min_depth_m
    rows, depth = rows[ahead], depth[ahead]
    pixels = np.stack([u[ahead] / depth, v[ahead] / depth], axis=1)
    column, row = np.floor(pixels + 0.5).T
    height, width = image_size
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return rows[inside], pixels[inside]


def point_edges(xyz, k, sigma):
    n = len(xyz)
    k = min(k, max(n - 1, 0))
    squared = cdist(xyz, xyz, "sqeuclidean") if n else np.zeros((0, 0))
    np.fill_diagonal(squared, -1)
    # a stable sort leaves equally distant points in the order of their indices; the first is the point itself
    nearest = np.argsort(squared, axis=1, kind="stable")[:, : k + 1]
    np.fill_diagonal(squared, 0)
    rows = np.repeat(np.arange(n), nearest.shape[1])
    weights = np.exp(-squared[rows, nearest.ravel()] / sigma)
    return coo_array((weights, (rows, nearest.ravel())), shape=(n, n)).tocsr()


def pixel_edges(pixels, masks, window, pixel_weight):
    height, width = masks.shape[1:]
    background = ~masks.any(axis=0)
    layers = np.concatenate([background[None], masks])
    labels, mass = np.zeros((len(pixels), len(layers))), np.zeros(len(pixels))
    reach = window // 2
    for i, (column, row) in enumerate(np.floor(pixels + 0.5).astype(int)):
        rows = slice(max(row - reach, 0), min(row + reach, height - 1) + 1)
        columns = slice(max(column - reach, 0), min(column + reach, width - 1) + 1)
        labels[i] = pixel_weight * layers[:, rows, columns].sum(axis=(1, 2))
        mass[i] = pixel_weight * layers[0, rows, columns].size
    return labels, mass


def largest_components(edges, labels):
    kept = np.zeros_like(labels)
    for m in range(1, labels.max(initial=0) + 1):
        members = np.flatnonzero(labels == m)
        _, component = connected_components(edges[members][:, members], directed=False)
        if len(members):
            # components are numbered by their first member, and argmax takes the first of equals
            kept[members[component == np.bincount(component).argmax()]] = m
    return kept
