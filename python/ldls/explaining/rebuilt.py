"""The graph and the linear system of a segmentation, built again: results keep the points and pixels, not the edges.

    system = rebuild(result)
    z = stages.diffuse(system.A, system.b, iterations=result.params.iterations)

Rows are those of `system.in_graph`, columns of b the labels 0, 1, ... of `result`, for one camera and for a ring. Needs
the extra `eval`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import ldls.stages as stages
from ldls._optional import require
from ldls.errors import InputError
from ldls.masks import InstanceMasks
from ldls.segmentation import Segmentation
from ldls.view import SeenView

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@dataclass(frozen=True, eq=False, kw_only=True)
class Rebuilt:
    """The graph over n of the v points in view and the M + 1 labels of a segmentation.

    Attributes:
        in_graph: (n,) int64: row in the cloud of each point of the graph: all in view but cleared ones.
        heights: (v,) float64 height of each point of `result.in_view` above the ground in metres; NaN where no ground
            is found. None where the parameters need none.
        depths: Depth groups of each view, of the points that it sees; None where the parameters ask for none.
        graph: (n, n) sparse: weights of the point edges, 1 to the point itself; not normalised.
        pixel_labels: Weights of the pixel edges by label, those of all cameras added up; not normalised.
        A: (n, n) sparse: the point edges, normalised together with the pixel edges.
        b: (n, M + 1) sparse: the pixel edges by label, normalised together with the point edges.
    """

    in_graph: NDArray[np.int64]
    heights: NDArray[np.float64] | None
    depths: tuple[stages.DepthGroups | None, ...]
    graph: csr_array
    pixel_labels: stages.PixelLabels
    A: csr_array
    b: csr_array


def rebuild(result: Segmentation) -> Rebuilt:
    """The graph and the linear system z <- A z + b that gave `result` (steps 2 to 4).

    Raises:
        InputError: It was labelled together with other sweeps, whose points it does not hold.
        ImportError: The extra `eval` is not installed.
    """
    if result.report.n_sweeps > 1:
        raise InputError(
            f"result: its graph has {result.report.n_sweeps} sweeps, of which it holds one; segment the sweep alone "
            "(ldls.segment, or ldls run without --sweeps)"
        )
    params, heights = result.params, _heights(result)
    depths = tuple(depth_groups_of(result, seen, heights) for seen in result.views)
    rows = _in_graph(result, heights)
    in_graph = result.in_view[rows]
    points = result.points[in_graph]
    indices, _ = stages.neighbors(points, params.neighbors, threads=params.threads)
    graph = stages.point_graph(
        points,
        indices,
        heights=None if heights is None else heights[rows],
        sigma=params.sigma,
        ground_edges=params.ground_edges,
        threads=params.threads,
    )
    labels = _pixel_labels(result, in_graph, depths)
    A, b = stages.normalize_rows(graph, labels)
    return Rebuilt(in_graph=in_graph, heights=heights, depths=depths, graph=graph, pixel_labels=labels, A=A, b=b)


def refused_labels(result: Segmentation) -> NDArray[np.int32]:
    """(N,) int32: label of the object that direct projection gives each point to and depth does not; 0 where none.

    0 too for cleared points, whose depth does not matter.
    """
    labels, heights = np.zeros(len(result.labels), np.int32), _heights(result)
    for seen in result.views:
        depths = depth_groups_of(result, seen, heights)
        if depths is None:
            return labels
        direct = stages.direct_labels(seen.pixels, seen.view.masks)
        for mask, label in enumerate(seen.labels.tolist()):
            refused = (direct == mask + 1) & (depths.behind_m(mask) != 0)
            labels[seen.in_view[refused]] = label
    labels[np.delete(result.in_view, _in_graph(result, heights))] = 0
    return labels


def _in_graph(result: Segmentation, heights: NDArray[np.float64] | None) -> NDArray[np.int64]:
    """Rows of the points in view that the graph has."""
    if heights is None:
        return np.arange(len(result.in_view))
    return stages.in_graph(heights, ground_clearance=result.params.ground_clearance)


def _heights(result: Segmentation) -> NDArray[np.float64] | None:
    params = result.params
    needed = params.ground_edges < 1 or params.ground_clearance > 0 or params.depth_gap > 0
    if not needed or not result.views:
        return None
    points, camera = result.points[result.in_view], result.views[0].view.camera
    return stages.ground(points, camera, local_ground=params.local_ground, threads=params.threads)


def depth_groups_of(
    result: Segmentation, seen: SeenView, heights: NDArray[np.float64] | None, masks: InstanceMasks | None = None
) -> stages.DepthGroups | None:
    """The depth groups of a view, or of some of its `masks`; None where the parameters ask for none."""
    params = result.params
    if heights is None or not params.depth_gap > 0:
        return None
    return stages.depth_groups(
        result.points[seen.in_view],
        seen.pixels,
        seen.view.masks if masks is None else masks,
        seen.view.camera,
        heights[np.searchsorted(result.in_view, seen.in_view)],
        depth_gap=params.depth_gap,
        bridged_gap=params.bridged_gap,
        edge_margin=params.edge_margin,
        threads=params.threads,
    )


def _pixel_labels(
    result: Segmentation, in_graph: NDArray[np.int64], depths: tuple[stages.DepthGroups | None, ...]
) -> stages.PixelLabels:
    sparse = require("scipy.sparse", "eval")
    shape = (len(in_graph), len(result.instances) + 1)
    weights, mass = sparse.csr_array(shape, dtype=np.float32), np.zeros(shape[0], np.float32)
    for seen, groups in zip(result.views, depths, strict=True):
        slots = np.flatnonzero(np.isin(seen.in_view, in_graph))
        own = stages.pixel_labels(
            seen.pixels[slots],
            seen.view.masks,
            window=result.params.window,
            depths=None if groups is None else groups.of_points(slots),
            pixel_weight=result.params.pixel_weight,
            threads=result.params.threads,
        )
        rows = np.searchsorted(in_graph, seen.in_view[slots])
        entries = own.weights.tocoo()
        place = (rows[entries.row], np.array([0, *seen.labels])[entries.col])
        weights = weights + sparse.csr_array((entries.data, place), shape=shape)
        mass[rows] += own.mass
    return stages.PixelLabels(weights, mass)
