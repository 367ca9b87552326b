"""Why a point has its label."""

from __future__ import annotations

import math
import operator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.errors import InputError, ParameterError
from ldls.influence import influences
from ldls.rebuilt import Rebuilt, rebuild
from ldls.segmentation import Segmentation
from ldls.sight import Sight, sights_of
from ldls.verdict import verdict_of

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@dataclass(frozen=True, kw_only=True)
class Neighbor:
    """One of the nearest neighbours of a point, an edge from which label flows to it.

    Attributes:
        point: Its row in the cloud.
        distance_m: How far it is, in metres.
        weight: exp(-d^2 / sigma).
        share: That weight over the sum of all edges of the point, its pixel edges included.
        label: Its label in the result.
        diffused_label: The same before outlier removal.
    """

    point: int
    distance_m: float
    weight: float
    share: float
    label: int
    diffused_label: int


@dataclass(frozen=True, kw_only=True)
class Likelihood:
    """Likelihood of one label at a point.

    Attributes:
        label: The label; 0 is the background.
        value: z after the last product.
        share: That over the sum of all labels.
    """

    label: int
    value: float
    share: float


@dataclass(frozen=True, kw_only=True)
class Edges:
    """What the edges of a point weigh, as shares of their sum.

    Attributes:
        own: Edge to itself.
        neighbors: Edges to its nearest neighbours.
        pixels: Edges to the pixels of its windows.
    """

    own: float
    neighbors: float
    pixels: float


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Whose pixels the likelihood of a point's diffused label comes from.

    Attributes:
        own_share: Share that its own pixels bring; the others' came along edges.
        half_within_m: Distance from it within which half of the likelihood begins, in metres.
    """

    own_share: float
    half_within_m: float


@dataclass(frozen=True, kw_only=True)
class Components:
    """The connected components of the points of one diffused label.

    Attributes:
        label: The label.
        sizes: Points of each, the largest first; of equal ones the one with the lowest row of the cloud first.
        own: Which of them the point lies in, from 0.
        removal: Whether outliers were removed, so that number 0 alone was kept.
    """

    label: int
    sizes: tuple[int, ...]
    own: int
    removal: bool

    @property
    def removed(self) -> bool:
        """Whether the point lost its label."""
        return self.removal and self.own > 0


@dataclass(frozen=True, kw_only=True)
class Island:
    """The part of the whole point graph that a point lies in; no label crosses to another.

    Attributes:
        points: Points of it.
        islands: Such parts of the graph.
    """

    points: int
    islands: int


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """What decided the label of one point; `print(explanation.verdict)` says it in a sentence.

    Attributes:
        point: Its row in the cloud.
        xyz: Its coordinates in the lidar frame in metres.
        label: Its label: -1 out of view, 0 background, m instance m.
        diffused_label: The same before outlier removal.
        names: Name of every label of the result, -1 and 0 included.
        sights: What each camera has of it.
        edges: What its edges weigh; None out of view, as all that follows.
        neighbors: Its nearest neighbours, the nearest first; empty out of view.
        likelihoods: Likelihoods of all labels that have any, the highest first; empty out of view.
        provenance: Where the likelihood of the diffused label comes from.
        components: Those of its diffused label, if that is an instance.
        island: The part of the graph it lies in.
    """

    point: int
    xyz: tuple[float, float, float]
    label: int
    diffused_label: int
    names: dict[int, str]
    sights: tuple[Sight, ...]
    edges: Edges | None = None
    neighbors: tuple[Neighbor, ...] = ()
    likelihoods: tuple[Likelihood, ...] = ()
    provenance: Provenance | None = None
    components: Components | None = None
    island: Island | None = None

    @property
    def winner(self) -> Likelihood | None:
        """The likelihood of the diffused label; None out of view."""
        return next((each for each in self.likelihoods if each.label == self.diffused_label), None)

    @property
    def runner_up(self) -> Likelihood | None:
        """The highest likelihood of another label; None where there is none."""
        return next((each for each in self.likelihoods if each.label != self.diffused_label), None)

    @property
    def verdict(self) -> str:
        """Why the point has its label, in a sentence."""
        return verdict_of(self)

    def to_dict(self) -> dict[str, Any]:
        """The same as plain values that JSON can hold, the verdict first; numbers that are not finite are None."""
        return {"verdict": self.verdict, **_finite(asdict(self))}

    def __str__(self) -> str:
        return self.verdict


def explain(result: Segmentation, point: int) -> Explanation:
    """Why the point in row `point` of the cloud of `result` has its label. Needs the extra `eval`.

    The graph of the result is built again, and the likelihoods of this point are those of plain products in double
    precision.

    Raises:
        ParameterError: `point` is no row of the cloud.
        InputError: The result is not of these points: its labels are of another number.
        ImportError: The extra `eval` is not installed.
    """
    point = _checked_row(point, len(result.points))
    if len(result.labels) != len(result.points):
        raise InputError(f"result: {len(result.labels)} labels, expected one for each of {len(result.points)} points")
    x, y, z = result.points[point, :3].astype(np.float64).tolist()
    seen: dict[str, Any] = {}
    row = int(np.searchsorted(result.in_view, point))
    if row < len(result.in_view) and result.in_view[row] == point:
        seen = _in_the_graph(result, rebuild(result), row)
    return Explanation(
        point=point,
        xyz=(x, y, z),
        label=int(result.labels[point]),
        diffused_label=int(result.diffused_labels[point]),
        names={-1: "out of view", 0: "background", **{each.label: each.name for each in result.instances}},
        sights=sights_of(result, point),
        **seen,
    )


def _checked_row(point: int, count: int) -> int:
    try:
        row = operator.index(point)
    except TypeError:
        raise ParameterError(f"point: got {point!r}, expected a whole number, its row in the cloud") from None
    if isinstance(point, bool) or not 0 <= row < count:
        expected = f"0 to {count - 1}" if count else "nothing, for the cloud is empty"
        raise ParameterError(f"point: got {point!r}, expected {expected}, its row in the cloud")
    return row


def _in_the_graph(result: Segmentation, system: Rebuilt, row: int) -> dict[str, Any]:
    xyz = result.points[system.in_view, :3].astype(np.float64)
    distances = np.linalg.norm(xyz - xyz[row], axis=1)
    diffused = result.diffused_labels[system.in_view]
    weights = influences(system.A, row, result.params.iterations)
    neighbors = _neighbors(result, system, row, distances)
    own = float(_entries(system.A, row)[row])
    flowing = sum(each.share for each in neighbors)
    return {
        "edges": Edges(own=own, neighbors=flowing, pixels=max(0.0, 1.0 - own - flowing)),
        "neighbors": neighbors,
        "likelihoods": _likelihoods(weights @ system.b.astype(np.float64), int(diffused[row])),
        "provenance": _provenance(weights * _column(system.b, int(diffused[row])), distances, row),
        "components": _components(system.graph, result, row) if diffused[row] else None,
        "island": _island(system.graph, row),
    }


def _entries(matrix: csr_array, row: int) -> dict[int, float]:
    """Columns and values of a row."""
    own = slice(matrix.indptr[row], matrix.indptr[row + 1])
    return dict(zip(matrix.indices[own].tolist(), matrix.data[own].tolist(), strict=True))


def _column(matrix: csr_array, column: int) -> NDArray[np.float64]:
    return np.asarray(matrix[:, [column]].toarray()[:, 0], np.float64)


def _neighbors(result: Segmentation, system: Rebuilt, row: int, distances: NDArray[np.float64]) -> tuple[Neighbor, ...]:
    shares = _entries(system.A, row)
    edges = [(j, weight) for j, weight in _entries(system.graph, row).items() if j != row]
    return tuple(
        Neighbor(
            point=int(system.in_view[j]),
            distance_m=float(distances[j]),
            weight=weight,
            share=shares[j],
            label=int(result.labels[system.in_view[j]]),
            diffused_label=int(result.diffused_labels[system.in_view[j]]),
        )
        for j, weight in sorted(edges, key=lambda edge: (distances[edge[0]], edge[0]))
    )


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


def _components(graph: csr_array, result: Segmentation, row: int) -> Components:
    diffused = result.diffused_labels[result.in_view]
    members = np.flatnonzero(diffused == diffused[row])
    component = _connected(_structure(graph)[members][:, members])
    sizes = np.bincount(component)
    # numbers are given in the order of the first members, and a stable sort keeps it among equals
    in_order = np.argsort(-sizes, kind="stable")
    own = component[np.searchsorted(members, row)]
    return Components(
        label=int(diffused[row]),
        sizes=tuple(sizes[in_order].tolist()),
        own=int(np.flatnonzero(in_order == own)[0]),
        removal=result.params.remove_outliers,
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
    found: NDArray[np.int32] = component
    return found


def _finite(value: Any) -> Any:  # noqa: ANN401 - whatever asdict yields
    if isinstance(value, dict):
        return {str(key): _finite(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
