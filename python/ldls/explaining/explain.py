"""Explain the label of a point by its pixels, its edges and the origin of its likelihood."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls
import ldls.stages as stages
from ldls._optional import require
from ldls.checks import checked, shown
from ldls.errors import InputError, ParameterError
from ldls.explaining.explanation import Components, Edges, Explanation, Island, Likelihood, Neighbor, Provenance
from ldls.explaining.rebuilt import Rebuilt, rebuild
from ldls.explaining.sight import sights_of
from ldls.segmentation import Segmentation

if TYPE_CHECKING:
    from scipy.sparse import csr_array

LEFT = 1e-9
"""Change by one more product, 1 at first, below which a converged solution leaves out the rest."""
MOST_PRODUCTS = 20_000


@checked
def explain(result: Segmentation, point: int) -> Explanation:
    """Explain the label of the point in row `point` of the cloud of `result`. Needs the extra `eval`.

    The graph of the result is built again, and the likelihoods of this point are those of plain products in double
    precision. Where all are less than 1e-12 of the largest seed they count as zero, as in the diffusion.

    Raises:
        ParameterError: `point` is no row of the cloud.
        InputError: The result is not of these points: its labels are of another number; or it was labelled together
            with other sweeps, whose points it does not hold; or the point has the label of another sweep, by a tracker.
        ImportError: The extra `eval` is not installed.
    """
    count = len(result.points)
    if not 0 <= point < count:
        expected = f"expected 0 to {count - 1}, its row in the cloud" if count else "the cloud is empty"
        raise ParameterError(f"point: got {shown(point)}, {expected}")
    point = operator.index(point)
    if len(result.labels) != count:
        raise InputError(f"result: {len(result.labels)} labels, expected one for each of {count} points")
    label, diffused = int(result.labels[point]), int(result.diffused_labels[point])
    if label > 0 and label != diffused:
        raise InputError(
            f"point: {point} has label {label} from another sweep, by the tracker, and not from its graph; explain the "
            "result before it was tracked"
        )
    x, y, z = result.points[point, :3].astype(np.float64).tolist()
    seen: dict[str, Any] = {"sights": sights_of(result, point, None)}
    row = int(np.searchsorted(result.in_view, point))
    if row < len(result.in_view) and result.in_view[row] == point:
        seen = _in_view(result, rebuild(result), row)
    return Explanation(
        point=point,
        xyz=(x, y, z),
        label=label,
        confidence=float(result.confidence[point]),
        abstain=result.params.abstain,
        diffused_label=diffused,
        names={-1: "out of view", 0: "background", **{each.label: each.name for each in result.instances}},
        **seen,
    )


def _in_view(result: Segmentation, system: Rebuilt, at: int) -> dict[str, Any]:
    """What decided the label of the point in row `at` of those in view."""
    point = int(result.in_view[at])
    row = int(np.searchsorted(system.in_graph, point))
    in_the_graph = row < len(system.in_graph) and system.in_graph[row] == point
    return {
        "sights": sights_of(result, point, system),
        "height_m": None if system.heights is None or np.isnan(system.heights[at]) else float(system.heights[at]),
        "clearance_m": result.params.ground_clearance,
        **(_in_the_graph(result, system, row) if in_the_graph else {}),
    }


def _in_the_graph(result: Segmentation, system: Rebuilt, row: int) -> dict[str, Any]:
    xyz = result.points[system.in_graph, :3].astype(np.float64)
    distances = np.linalg.norm(xyz - xyz[row], axis=1)
    diffused = result.diffused_labels[system.in_graph]
    weights = influences(system.A, row, result.params.iterations)
    z = weights @ system.b.astype(np.float64)
    if z.max() < _ldls.NEGLIGIBLE * system.b.data.max(initial=0):
        z[:] = 0
    neighbors = _neighbors(result, system, row, distances)
    own = float(_entries(system.A, row)[row])
    flowing = sum(each.share for each in neighbors)
    column = system.b[:, [int(diffused[row])]].toarray()[:, 0].astype(np.float64)
    return {
        "edges": Edges(own=own, neighbors=flowing, pixels=max(0.0, 1.0 - own - flowing)),
        "neighbors": neighbors,
        "likelihoods": _likelihoods(z, int(diffused[row])),
        "provenance": _provenance(weights * column, distances, row),
        "components": _components(system, result, row) if diffused[row] else None,
        "island": _island(system.graph, row),
    }


def _entries(matrix: csr_array, row: int) -> dict[int, float]:
    """Columns and values of a row."""
    own = slice(matrix.indptr[row], matrix.indptr[row + 1])
    return dict(zip(matrix.indices[own].tolist(), matrix.data[own].tolist(), strict=True))


def _neighbors(result: Segmentation, system: Rebuilt, row: int, distances: NDArray[np.float64]) -> tuple[Neighbor, ...]:
    shares = _entries(system.A, row)
    ground = _ground(result, system)
    edges = [(j, weight) for j, weight in _entries(system.graph, row).items() if j != row]
    return tuple(
        Neighbor(
            point=int(system.in_graph[j]),
            distance_m=float(distances[j]),
            weight=weight,
            leaves_ground=bool(ground[j] != ground[row]),
            share=shares[j],
            label=int(result.labels[system.in_graph[j]]),
            diffused_label=int(result.diffused_labels[system.in_graph[j]]),
        )
        for j, weight in sorted(edges, key=lambda edge: (distances[edge[0]], edge[0]))
    )


def _ground(result: Segmentation, system: Rebuilt) -> NDArray[np.bool_]:
    """(n,) True for points of the ground, where edges that leave it are weakened."""
    if system.heights is None or result.params.ground_edges == 1:
        return np.zeros(len(system.in_graph), bool)
    return stages.on_ground(system.heights[np.searchsorted(result.in_view, system.in_graph)])


def _likelihoods(z: NDArray[np.float64], diffused_label: int) -> tuple[Likelihood, ...]:
    total = z.sum()
    # a stable sort leaves equal ones in the order of their labels
    in_order = np.argsort(-z, kind="stable").tolist()
    return tuple(
        Likelihood(label=label, value=float(z[label]), share=float(z[label] / total) if total > 0 else 0.0)
        for label in in_order
        if z[label] > 0 or label == diffused_label
    )


def _provenance(parts: NDArray[np.float64], distances: NDArray[np.float64], row: int) -> Provenance | None:
    total = parts.sum()
    if not total > 0:
        return None
    outwards = np.argsort(distances, kind="stable")
    half = int(np.searchsorted(np.cumsum(parts[outwards]), total / 2))
    nearest_half = outwards[min(half, len(outwards) - 1)]
    return Provenance(own_share=float(parts[row] / total), half_within_m=float(distances[nearest_half]))


def _components(system: Rebuilt, result: Segmentation, row: int) -> Components:
    diffused = result.diffused_labels[system.in_graph]
    members = np.flatnonzero(diffused == diffused[row])
    component = _connected(_structure(system.graph)[members][:, members])
    sizes = np.bincount(component)
    xyz = result.points[system.in_graph[members], :3].astype(np.float64)
    # numbers are given in the order of the first members, and a stable sort keeps it among equals
    in_order = np.argsort(-sizes, kind="stable")
    own = component[np.searchsorted(members, row)]
    tree = require("scipy.spatial", "eval").cKDTree(xyz[component == in_order[0]])
    gaps, _ = tree.query(xyz)
    return Components(
        label=int(diffused[row]),
        sizes=tuple(sizes[in_order].tolist()),
        gaps_m=tuple(float(gaps[component == number].min()) for number in in_order),
        own=int(np.flatnonzero(in_order == own)[0]),
        removal=result.params.remove_outliers,
        part_gap=result.params.part_gap,
    )


def _island(graph: csr_array, row: int) -> Island:
    island = _connected(_structure(graph))
    sizes = np.bincount(island)
    return Island(points=int(sizes[island[row]]), islands=len(sizes))


def _structure(graph: csr_array) -> csr_array:
    """`graph` with an entry of 1 for each edge: edges over which next to nothing flows connect as well."""
    sparse = require("scipy.sparse", "eval")
    ones = np.ones(len(graph.indices), np.int8)
    return sparse.csr_array((ones, graph.indices, graph.indptr), shape=graph.shape)


def _connected(graph: csr_array) -> NDArray[np.int32]:
    _, component = require("scipy.sparse.csgraph", "eval").connected_components(graph, directed=False)
    numbers: NDArray[np.int32] = component
    return numbers


def influences(A: csr_array, row: int, iterations: int | None) -> NDArray[np.float64]:
    """Return (n,) r, the influence of each point's pixels on the point in `row`, whose likelihoods are r b.

    Likelihoods are z = (1 + A + ... + A^(iterations - 1)) b (step 5); r is one row of that polynomial, the sum of the
    products of the transpose of A with a unit vector, in double precision. It costs one vector instead of one for each
    label, and shows where a label comes from.

    Args:
        A: (n, n) of `stages.normalize_rows`.
        row: The point.
        iterations: Number of products; None until what comes is lost in rounding.
    """
    transpose = A.T.tocsr().astype(np.float64)
    own = np.zeros(A.shape[0])
    own[row] = 1.0
    total = own.copy()
    for _ in range(1, MOST_PRODUCTS if iterations is None else iterations):
        own = transpose @ own
        total += own
        if iterations is None and own.sum() < LEFT:
            break
    return total
