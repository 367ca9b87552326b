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


def segment_ring(points, views, params, *, same_object=0.5, min_depth_m=0.1):
    """`views` holds masks (M, H, W), categories (M,) and a camera matrix for each camera. Labels, and the instances
    (camera, mask), both from 0, of each label from 1."""
    seen = [project(points, matrix, masks.shape[1:], min_depth_m) for masks, _, matrix in views]
    in_view = np.unique(np.concatenate([rows for rows, _ in seen]))
    groups = same_objects(views, seen, same_object)
    labels, mass = np.zeros((len(in_view), len(groups) + 1)), np.zeros(len(in_view))
    for camera, ((masks, _, _), (rows, pixels)) in enumerate(zip(views, seen, strict=True)):
        of_instance = [0] + [1 + [(camera, m) in group for group in groups].index(True) for m in range(len(masks))]
        own, own_mass = pixel_edges(pixels, masks, params.window, params.pixel_weight)
        at = np.searchsorted(in_view, rows)
        for instance, label in enumerate(of_instance):
            labels[at, label] += own[:, instance]
        mass[at] += own_mass
    edges = point_edges(points[in_view, :3].astype(np.float64), params.neighbors, params.sigma)
    row_sums = edges.sum(axis=1) + mass
    A, b = diags_array(1 / row_sums, shape=edges.shape) @ edges, labels / row_sums[:, None]
    z = np.zeros_like(b)
    for _ in range(params.iterations):
        z = A @ z + b
    kept = largest_components(edges, z.argmax(axis=1))
    whole = np.full(len(points), -1)
    whole[in_view] = kept
    return whole, groups


def same_objects(views, seen, same_object):
    """Groups of instances, the pairs that agree best joined first; one instance a camera."""
    pairs = []
    for one in range(len(views)):
        for other in range(one + 1, len(views)):
            _, here, there = np.intersect1d(seen[one][0], seen[other][0], return_indices=True)
            covers = []
            for camera, at in ((one, here), (other, there)):
                column, row = np.floor(seen[camera][1][at] + 0.5).astype(int).reshape(-1, 2).T
                covers.append(views[camera][0][:, row, column])
            for m, first in enumerate(covers[0]):
                for k, second in enumerate(covers[1]):
                    both, either = (first & second).sum(), (first | second).sum()
                    same_category = views[one][1][m] == views[other][1][k]
                    if both and same_category and both >= same_object * either:
                        pairs.append((-both / either, (one, m), (other, k)))
    groups = [[(camera, m)] for camera, view in enumerate(views) for m in range(len(view[0]))]
    for _, first, second in sorted(pairs):
        a, b = (next(g for g in groups if instance in g) for instance in (first, second))
        if a is not b and not {camera for camera, _ in a} & {camera for camera, _ in b}:
            groups[min(groups.index(a), groups.index(b))] = sorted(a + b)
            groups.remove(b if b in groups else a)
    return groups


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
