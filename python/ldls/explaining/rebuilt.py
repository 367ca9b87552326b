"""The graph and the linear system of a segmentation, built again: results keep the points and pixels, not the edges.

    system = rebuild(result)
    z = stages.diffuse(system.A, system.b, iterations=result.params.iterations)

Rows are those of `result.in_view`, columns of b the labels 0, 1, ... of `result`, for one camera and for a ring.
Needs the extra `eval`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import ldls.stages as stages
from ldls._optional import require
from ldls.segmentation import Segmentation
from ldls.view import SeenView

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@dataclass(frozen=True, eq=False, kw_only=True)
class Rebuilt:
    """The graph over the n points in view and the M + 1 labels of a segmentation.

    Attributes:
        in_view: (n,) int64: row in the cloud of each point of the graph.
        graph: (n, n) sparse: weights of the point edges, 1 to the point itself; not normalised.
        pixel_labels: Weights of the pixel edges by label, those of all cameras added up; not normalised.
        A: (n, n) sparse: the point edges, normalised together with the pixel edges.
        b: (n, M + 1) sparse: the pixel edges by label, normalised together with the point edges.
    """

    in_view: NDArray[np.int64]
    graph: csr_array
    pixel_labels: stages.PixelLabels
    A: csr_array
    b: csr_array


def rebuild(result: Segmentation) -> Rebuilt:
    """The graph and the linear system z <- A z + b that gave `result` (steps 2 to 4).

    Raises:
        ImportError: The extra `eval` is not installed.
    """
    points, params = result.points[result.in_view], result.params
    indices, _ = stages.neighbors(points, params.neighbors, threads=params.threads)
    graph = stages.point_graph(points, indices, sigma=params.sigma, threads=params.threads)
    labels = _pixel_labels(result)
    A, b = stages.normalize_rows(graph, labels)
    return Rebuilt(in_view=result.in_view, graph=graph, pixel_labels=labels, A=A, b=b)


def _pixel_labels(result: Segmentation) -> stages.PixelLabels:
    sparse = require("scipy.sparse", "eval")
    shape = (len(result.in_view), len(result.instances) + 1)
    weights, mass = sparse.csr_array(shape, dtype=np.float32), np.zeros(shape[0], np.float32)
    for seen in result.views:
        own = _pixel_labels_of(seen, result)
        rows = np.searchsorted(result.in_view, seen.in_view)
        entries = own.weights.tocoo()
        place = (rows[entries.row], np.array([0, *seen.labels])[entries.col])
        weights = weights + sparse.csr_array((entries.data, place), shape=shape)
        mass[rows] += own.mass
    return stages.PixelLabels(weights, mass)


def _pixel_labels_of(seen: SeenView, result: Segmentation) -> stages.PixelLabels:
    params = result.params
    return stages.pixel_labels(
        seen.pixels,
        seen.view.masks,
        window=params.window,
        pixel_weight=params.pixel_weight,
        threads=params.threads,
    )
