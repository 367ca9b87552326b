"""The method as slow, plain float64 NumPy and SciPy, straight from its definition: what is right."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import distance_transform_cdt
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
    xyz: np.ndarray
    in_graph: np.ndarray

    def remove_outliers(self, labels, params):
        """Step 7, of labels of the points in view."""
        kept, own = np.zeros_like(labels), labels[self.in_graph]
        parts = largest_components(self.edges, own, self.xyz, params.part_gap) if params.remove_outliers else own
        kept[self.in_graph] = parts
        return kept


def segment(points, masks, camera_matrix, params, *, min_depth_m=0.1, heights=None, center=None):
    """`points` (N, 3), `masks` (M, H, W) bool, `camera_matrix` (3, 4) from lidar to homogeneous pixels.

    `heights` of the points in view above the ground and the `center` (3,) of the camera matter where `params` ask.
    """
    in_view, pixels = project(points, camera_matrix, masks.shape[1:], min_depth_m)
    xyz = points[in_view].astype(np.float64)
    heights = np.full(len(xyz), np.nan) if heights is None else heights
    ground, in_graph = (heights > -0.3) & (heights < 0.15), ~cleared(heights, params)
    admitted = np.ones((len(xyz), len(masks) + 1), bool)
    if params.depth_gap > 0:
        admitted = depth_groups(np.linalg.norm(xyz - center, axis=1), pixels, masks, ~ground, params)
    labels, mass = pixel_edges(pixels, masks, params.window, params.pixel_weight)
    labels, mass, xyz = (labels * admitted)[in_graph], mass[in_graph], xyz[in_graph]
    edges = point_edges(xyz, params.neighbors, params.sigma, ground[in_graph], params.ground_edges)
    row_sums = edges.sum(axis=1) + mass
    A = diags_array(1 / row_sums, shape=edges.shape) @ edges
    b = labels / row_sums[:, None]
    z = np.zeros_like(b)
    for _ in range(params.iterations):
        z = A @ z + b
    likelihood = np.zeros((len(in_view), z.shape[1]))
    likelihood[in_graph] = z
    diffused = likelihood.argmax(axis=1)
    expected = Expected(in_view, pixels, diffused, diffused, likelihood, edges, xyz, in_graph)
    expected.labels = expected.remove_outliers(diffused, params)
    return expected


def segment_ring(points, views, params, *, same_object=0.5, min_depth_m=0.1, heights=None, centers=None, rows=None):
    """`views` holds masks (M, H, W), categories (M,) and a camera matrix for each camera. Labels, and the instances
    (camera, mask), both from 0, of each label from 1. `heights`, and `centers` of the cameras, are as in `segment`.
    `rows` has the first row and the one after the last that was swept at the moment of each view."""
    seen = [project(points, matrix, masks.shape[1:], min_depth_m) for masks, _, matrix in views]
    in_view = np.unique(np.concatenate([rows for rows, _ in seen]))
    xyz = points[in_view, :3].astype(np.float64)
    heights = np.full(len(xyz), np.nan) if heights is None else heights
    ground = (heights > -0.3) & (heights < 0.15)
    shown = points_shown(views, seen)
    if rows is not None and params.depth_gap > 0:
        # masks show the points of other moments that are as far away as what they show of their own
        for camera, ((masks, _, _), (own_rows, pixels), (start, end)) in enumerate(zip(views, seen, rows, strict=True)):
            at = np.searchsorted(in_view, own_rows)
            distances = np.linalg.norm(xyz[at] - centers[camera], axis=1)
            own = ~ground[at] & (own_rows >= start) & (own_rows < end)
            shown[camera] &= depth_groups(distances, pixels, masks, own, params, moved_m=1.0)[:, 1:].T
    groups = same_objects(views, seen, shown, same_object, rows)
    if rows is not None:
        seen = pixels_taken(views, seen, shown, groups, rows)
    labels, mass = np.zeros((len(in_view), len(groups) + 1)), np.zeros(len(in_view))
    for camera, ((masks, _, _), (rows, pixels)) in enumerate(zip(views, seen, strict=True)):
        of_instance = [0] + [1 + [(camera, m) in group for group in groups].index(True) for m in range(len(masks))]
        at = np.searchsorted(in_view, rows)
        admitted = np.ones((len(at), len(masks) + 1), bool)
        if params.depth_gap > 0:
            distances = np.linalg.norm(xyz[at] - centers[camera], axis=1)
            admitted = depth_groups(distances, pixels, masks, ~ground[at], params)
        own, own_mass = pixel_edges(pixels, masks, params.window, params.pixel_weight)
        for instance, label in enumerate(of_instance):
            labels[at, label] += own[:, instance] * admitted[:, instance]
        mass[at] += own_mass
    in_graph = ~cleared(heights, params)
    labels, mass, xyz = labels[in_graph], mass[in_graph], xyz[in_graph]
    edges = point_edges(xyz, params.neighbors, params.sigma, ground[in_graph], params.ground_edges)
    row_sums = edges.sum(axis=1) + mass
    A, b = diags_array(1 / row_sums, shape=edges.shape) @ edges, labels / row_sums[:, None]
    z = np.zeros_like(b)
    for _ in range(params.iterations):
        z = A @ z + b
    diffused = np.zeros(len(in_view), int)
    diffused[in_graph] = z.argmax(axis=1)
    expected = Expected(in_view, None, diffused, diffused, z, edges, xyz, in_graph)
    whole = np.full(len(points), -1)
    whole[in_view] = expected.remove_outliers(diffused, params)
    return whole, groups


def points_shown(views, seen):
    """For each view, (M, n) whether the pixel of each point that it sees is on each mask."""
    found = []
    for (masks, _, _), (_, pixels) in zip(views, seen, strict=True):
        column, row = np.floor(pixels + 0.5).astype(int).reshape(-1, 2).T
        found.append(masks[:, row, column])
    return found


def pixels_taken(views, seen, shown, groups, rows):
    """Rows and pixels of the points that take their pixels from each view: those of its moment, but for points where it
    has no mask and the nearest view of another moment shows an object that its moment overlooks."""
    times = sorted(set(rows))
    moment = [times.index(own) for own in rows]

    def masks_at(view, row):
        (at,) = np.flatnonzero(seen[view][0] == row)
        column, line = np.floor(seen[view][1][at] + 0.5).astype(int)
        return [m for m in range(len(views[view][0])) if views[view][0][m, line, column]]

    def lends(other, view, row):
        if row not in seen[other][0]:
            return False
        (at,) = np.flatnonzero(seen[other][0] == row)
        there = [next(g for g in groups if (other, m) in g) for m in np.flatnonzero(shown[other][:, at])]
        return any(overlooked([moment[member] - moment[view] for member, _ in group]) for group in there)

    def overlooked(later):
        around = min(later) < 0 < max(later)
        return len(later) >= 2 and 0 not in later and (around or -1 in later or 1 in later)

    taken = [[] for _ in views]
    for view in range(len(views)):
        others = [other for other in range(len(views)) if rows[other] != rows[view]]
        others.sort(key=lambda other: (abs(moment[other] - moment[view]), moment[other]))
        for row in seen[view][0][(seen[view][0] >= rows[view][0]) & (seen[view][0] < rows[view][1])]:
            lenders = [] if masks_at(view, row) else [other for other in others if lends(other, view, row)]
            taken[lenders[0] if lenders else view].append(row)
    parts = [np.isin(own_rows, own) for (own_rows, _), own in zip(seen, taken, strict=True)]
    return [(own_rows[part], pixels[part]) for (own_rows, pixels), part in zip(seen, parts, strict=True)]


def same_objects(views, seen, shown, same_object, rows=None):
    """Groups of instances, the pairs that agree best joined first; one instance a camera. Those of two categories come
    last, must agree on half, and are of views of two moments."""
    pairs = []
    for one in range(len(views)):
        for other in range(one + 1, len(views)):
            _, here, there = np.intersect1d(seen[one][0], seen[other][0], return_indices=True)
            for m, first in enumerate(shown[one][:, here]):
                for k, second in enumerate(shown[other][:, there]):
                    both, either = (first & second).sum(), (first | second).sum()
                    differ = views[one][1][m] != views[other][1][k]
                    possible = not differ or (rows is not None and rows[one] != rows[other])
                    if both and possible and both >= max(same_object, 0.5 * differ) * either:
                        pairs.append((differ, -both / either, (one, m), (other, k)))
    groups = [[(camera, m)] for camera, view in enumerate(views) for m in range(len(view[0]))]
    for _, _, first, second in sorted(pairs):
        a, b = (next(g for g in groups if instance in g) for instance in (first, second))
        if a is not b and not {camera for camera, _ in a} & {camera for camera, _ in b}:
            groups[min(groups.index(a), groups.index(b))] = sorted(a + b)
            groups.remove(b if b in groups else a)
    return groups


def cleared(heights, params):
    """(n,) True for points nearer to the ground than the clearance, which have no part in the graph."""
    return (heights > -0.3) & (heights < params.ground_clearance) & (params.ground_clearance > 0)


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


def depth_groups(distances, pixels, masks, standing, params, moved_m=0.0):
    """(n, M + 1) whether each point takes each label from pixels: the background and the masks.

    An object may have moved so far; then one that no point stands on is at any distance."""
    admitted = np.ones((len(distances), len(masks) + 1), bool)
    column, row = np.floor(pixels + 0.5).astype(int).reshape(-1, 2).T
    for m, mask in enumerate(masks):
        admitted[:, m + 1] = moved_m > 0
        if not mask.any():
            continue
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        shorter = min(np.ptp(rows), np.ptp(columns)) + 1
        margin = min(max(int(params.edge_margin * shorter), 3), 10)
        # a transform of an image without the other kind of pixel has no meaning
        inside = np.full(mask.shape, 10) if mask.all() else np.minimum(distance_transform_cdt(mask, "chessboard"), 10)
        outside = distance_transform_cdt(~mask, "chessboard") if not mask.all() else np.zeros(mask.shape)
        depth, beside = inside[row, column], outside[row, column]
        on_it = np.flatnonzero(standing & mask[row, column])
        near_it = standing & (beside > 0) & (beside <= margin)
        if not len(on_it):
            continue
        near, far = object_interval(distances[on_it], depth[on_it], distances[near_it], params)
        inside = (near - moved_m <= distances) & (distances <= far + moved_m)
        admitted[:, m + 1] = inside
        if params.edge_margin > 0:
            admitted[near_it & inside, 0] = False
    return admitted


def object_interval(distances, weights, beside, params):
    """Nearest and farthest distance of the heaviest group, with slack."""
    order = np.argsort(distances, kind="stable")
    groups = [[order[0]]]
    for point in order[1:]:
        last = distances[groups[-1][-1]]
        if distances[point] - last <= max(params.depth_gap, 0.03 * last):
            groups[-1].append(point)
        else:
            groups.append([point])

    def on_mask(group):
        low, high = distances[group[0]] - 0.3, distances[group[-1]] + 0.3
        others = ((beside >= low) & (beside <= high)).sum()
        return len(group) / (len(group) + others)

    chains = [[groups[0]]]
    for before, group in pairwise(groups):
        last = distances[before[-1]]
        near = distances[group[0]] - last <= max(params.bridged_gap, 0.1 * last)
        lighter = group if weights[group].sum() <= weights[before].sum() else before
        if params.bridged_gap > 0 and near and on_mask(lighter) >= 0.75:
            chains[-1].append(group)
        else:
            chains.append([group])
    joined = [np.concatenate(chain) for chain in chains]

    def weight(chain):
        return weights[chain].sum() * on_mask(chain) ** 2 / np.sqrt(max(distances[chain[0]], 0.3))

    best = max(joined, key=weight)
    return distances[best[0]] - 0.3, distances[best[-1]] + 0.3


def point_edges(xyz, k, sigma, ground=None, ground_edges=1.0):
    n = len(xyz)
    k = min(k, max(n - 1, 0))
    squared = cdist(xyz, xyz, "sqeuclidean") if n else np.zeros((0, 0))
    np.fill_diagonal(squared, -1)
    # a stable sort leaves equally distant points in the order of their indices; the first is the point itself
    nearest = np.argsort(squared, axis=1, kind="stable")[:, : k + 1]
    np.fill_diagonal(squared, 0)
    rows = np.repeat(np.arange(n), nearest.shape[1])
    weights = np.exp(-squared[rows, nearest.ravel()] / sigma)
    if ground is not None:
        weights[ground[rows] != ground[nearest.ravel()]] *= ground_edges
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


def largest_components(edges, labels, xyz, part_gap):
    kept = np.zeros_like(labels)
    for m in range(1, labels.max(initial=0) + 1):
        members = np.flatnonzero(labels == m)
        _, component = connected_components(edges[members][:, members], directed=False)
        if len(members):
            # components are numbered by their first member, and argmax takes the first of equals
            sizes = np.bincount(component)
            stays = component == sizes.argmax()
            if part_gap > 0:
                near = (cdist(xyz[members], xyz[members[stays]]) <= part_gap).any(axis=1)
                stays |= np.isin(component, component[near])
            kept[members[stays]] = m
    return kept
