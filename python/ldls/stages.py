"""The steps of the method one by one, arrays in and arrays out, with SciPy's sparse matrices for the graph.

    in_view, pixels = stages.project(points, camera, image_size=masks.image_size)
    heights = stages.ground(points[in_view], camera)
    depths = stages.depth_groups(points[in_view], pixels, masks, camera, heights)
    rows = stages.in_graph(heights)
    xyz, heights, pixels, depths = points[in_view][rows], heights[rows], pixels[rows], depths.of_points(rows)
    indices, squared_distances = stages.neighbors(xyz)
    graph = stages.point_graph(xyz, indices, heights=heights)
    A, b = stages.normalize_rows(graph, stages.pixel_labels(pixels, masks, depths=depths))
    z = stages.diffuse(A, b)
    labels = stages.remove_outliers(A, z.argmax(axis=1), points=xyz)
    confidence = stages.confidence(z, labels, masks)

equals `ldls.segment` on `in_view[rows]`; the other points in view are background. Without heights, depths and rows, and
with the options of `Params.paper()`, it is the paper's method. Options stand for the same as in `ldls.Params`. Needs
the extra `eval`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls._optional import require
from ldls.camera import Camera
from ldls.checks import as_image_size, checked, numbers, shown, whole_number
from ldls.cloud import as_points
from ldls.errors import DtypeError, InputError, NonFiniteError, ShapeError
from ldls.masks import InstanceMasks
from ldls.params import Params

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# with threads, an import does not ask the environment for them
_BEST = Params(threads=1)
GROUND_M = _ldls.GROUND_M
"""Heights in metres between which points are the ground's."""


@dataclass(frozen=True, eq=False)
class PixelLabels:
    """The pixel edges of n points, added up by label.

    Attributes:
        weights: (n, M + 1) sparse: weight of the pixel edges of each point that end in each label, background first.
        mass: (n,) float32: weight of all pixel edges of each point, a pixel under two masks counted once.
    """

    weights: csr_array
    mass: NDArray[np.float32]


@checked
@dataclass(frozen=True, eq=False)
class DepthGroups:
    """The object of each of M masks among n points in view, by distance to the camera.

    Attributes:
        intervals: (M, 2) float64 nearest and farthest distance of the object in metres; NaN where no point off the
            ground falls on the mask: there is no object.
        distances: (n,) float64 distance of each point to the camera in metres.
        unsure: (n,) bool: True where a point stands beside the edge of a mask, as far away as its object, so that
            background pixels say nothing of it.
    """

    intervals: NDArray[np.float64]
    distances: NDArray[np.float64]
    unsure: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, dtype, shape in (
            ("intervals", np.float64, ("M", 2)),
            ("distances", np.float64, ("n",)),
            ("unsure", np.bool_, ("n",)),
        ):
            object.__setattr__(self, name, numbers(name, getattr(self, name), dtype, shape))

    @property
    def core(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """The arrays as the core takes them."""
        return self.intervals, self.distances, self.unsure

    def of_points(self, rows: ArrayLike) -> DepthGroups:
        """The depth groups of some of the points alone: rows (m,) of the n, whole numbers."""
        chosen = numbers("rows", rows, np.int64, ("m",))
        if chosen.size and not 0 <= chosen.min() <= chosen.max() < len(self.distances):
            found = f"{chosen.min()} to {chosen.max()}"
            raise InputError(f"rows: got {found}, expected rows of the {len(self.distances)} points")
        return DepthGroups(self.intervals, self.distances[chosen], self.unsure[chosen])

    def behind_m(self, mask: int) -> NDArray[np.float64]:
        """How far behind the object of a mask, numbered from 0, each point (n,) is, in metres; negative before it.

        0 as far away as the object: the mask labels these points. NaN for all where there is no object.
        """
        near, far = self.intervals[mask]
        behind: NDArray[np.float64] = np.maximum(self.distances - far, 0.0) + np.minimum(self.distances - near, 0.0)
        return behind


@checked
def project(
    points: ArrayLike,
    camera: Camera,
    *,
    image_size: tuple[int, int],
    keep_origin: bool = False,
    threads: int | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Indices (n,) of the points in view and their pixels (n, 2), u and v (step 1).

    Args:
        points: (N, >= 3) in metres in the lidar frame.
        camera: The camera.
        image_size: (height, width) of its image in pixels.
        keep_origin: True if points at exactly (0, 0, 0) are more than missing returns.
        threads: As in `Params`.
    """
    Params(threads=threads)
    return _ldls.project(
        as_points(points),
        camera.core,
        *as_image_size("image_size", image_size),
        keep_origin,
        threads,
    )


@checked
def ground(
    points: ArrayLike, camera: Camera, *, local_ground: bool = _BEST.local_ground, threads: int | None = None
) -> NDArray[np.float64]:
    """Height (n,) of each point above the ground in metres; NaN for all where no ground is found.

    The ground is a surface of degree 5 through the lowest points of polar cells around the camera, fitted so that what
    stands on it does not count, and with `local_ground` what lies level around each point. Up is z of the lidar frame,
    or -y where the camera looks along its z, as in clouds that are in the frame of the camera.

    Args:
        points: (n, >= 3) finite, in metres.
        camera: The camera, for its place and for where up is.
        local_ground: As in `Params`.
        threads: As in `Params`.
    """
    Params(threads=threads)
    return _ldls.ground(_finite_xyz(points), camera.core, local_ground, threads)


@checked
def on_ground(heights: ArrayLike) -> NDArray[np.bool_]:
    """(n,) True for points that are the ground's: those from -0.3 m to 0.15 m above it.

    Args:
        heights: (n,) of `ground`.
    """
    above = numbers("heights", heights, np.float64, ("n",))
    return (above > GROUND_M[0]) & (above < GROUND_M[1])


@checked
def in_graph(heights: ArrayLike, *, ground_clearance: float = _BEST.ground_clearance) -> NDArray[np.int64]:
    """Rows (m,) of the points that the graph has, ascending; the others are cleared: background, for they are so low.

    Args:
        heights: (n,) of `ground`.
        ground_clearance: As in `Params`.
    """
    Params(ground_clearance=ground_clearance, threads=1)
    return _ldls.in_graph(numbers("heights", heights, np.float64, ("n",)), ground_clearance)


@checked
def depth_groups(
    points: ArrayLike,
    pixels: ArrayLike,
    masks: InstanceMasks,
    camera: Camera,
    heights: ArrayLike,
    *,
    depth_gap: float = _BEST.depth_gap,
    bridged_gap: float = _BEST.bridged_gap,
    edge_margin: float = _BEST.edge_margin,
    threads: int | None = None,
) -> DepthGroups:
    """The object of each mask among points by their distance to the camera.

    Args:
        points: (n, >= 3) finite, in metres.
        pixels: (n, 2) where they fall, u and v.
        masks: Masks of the image.
        camera: Its camera.
        heights: (n,) of `ground`.
        depth_gap: As in `Params`.
        bridged_gap: As in `Params`.
        edge_margin: As in `Params`.
        threads: As in `Params`.
    """
    xyz = _finite_xyz(points)
    uv = numbers("pixels", pixels, np.float64, (len(xyz), 2))
    above = numbers("heights", heights, np.float64, (len(xyz),))
    params = Params(depth_gap=depth_gap, bridged_gap=bridged_gap, edge_margin=edge_margin, threads=threads)
    return DepthGroups(*_ldls.depth_groups(xyz, uv, masks.core, camera.core, above, params))


@checked
def neighbors(
    points: ArrayLike, k: int = _BEST.neighbors, *, threads: int | None = None
) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
    """Indices and squared distances (n, k) of the nearest other points, nearest first (step 3).

    Of equally distant points the one of lower index is nearer. With fewer than k other points, k is their number.

    Args:
        points: (n, >= 3) finite, in metres.
        k: Neighbours wanted.
        threads: As in `Params`.
    """
    Params(neighbors=k, threads=threads)
    return _ldls.neighbors(_finite_xyz(points), k, threads)


@checked
def point_graph(
    points: ArrayLike,
    indices: ArrayLike,
    *,
    heights: ArrayLike | None = None,
    sigma: float = _BEST.sigma,
    ground_edges: float = _BEST.ground_edges,
    threads: int | None = None,
) -> csr_array:
    """Sparse (n, n) weights: 1 to itself and exp(-d^2 / sigma) to its neighbours (step 3); rows not normalised.

    With `heights`, edges between the ground and what stands on it weigh `ground_edges` times that.

    Args:
        points: (n, >= 3) finite, in metres.
        indices: (n, k) neighbours of each point.
        heights: (n,) of `ground`.
        sigma: In square metres.
        ground_edges: As in `Params`.
        threads: As in `Params`.
    """
    Params(sigma=sigma, ground_edges=ground_edges, threads=threads)
    xyz = _finite_xyz(points)
    columns = numbers("indices", indices, np.uint32, (len(xyz), "k"))
    ground_rows = None if heights is None else on_ground(numbers("heights", heights, np.float64, (len(xyz),)))
    return _csr(_ldls.point_graph(xyz, columns, sigma, ground_rows, ground_edges, threads), len(columns))


@checked
def pixel_labels(
    pixels: ArrayLike,
    masks: InstanceMasks,
    *,
    window: int = _BEST.window,
    depths: DepthGroups | None = None,
    pixel_weight: float = _BEST.pixel_weight,
    threads: int | None = None,
) -> PixelLabels:
    """The pixel edges of points that fall on `pixels` (n, 2), added up by label (step 2); not normalised.

    With `depths`, a mask labels points at the distance of its object only, and background pixels those that masks are
    sure of; the weight of other edges counts in the mass alone.
    """
    Params(window=window, pixel_weight=pixel_weight, threads=threads)
    uv = numbers("pixels", pixels, np.float64, ("n", 2))
    groups = None if depths is None else _checked(depths, len(uv), len(masks))
    weights, mass = _ldls.pixel_labels(uv, masks.core, window, pixel_weight, groups, threads)
    return PixelLabels(_csr(weights, len(masks) + 1), mass)


@checked
def direct_labels(pixels: ArrayLike, masks: InstanceMasks) -> NDArray[np.int32]:
    """Direct projection: the label (n,) of the pixel nearest to each of `pixels` (n, 2); of several, the first."""
    return _ldls.direct_labels(numbers("pixels", pixels, np.float64, ("n", 2)), masks.core)


@checked
def normalize_rows(graph: csr_array, labels: PixelLabels) -> tuple[csr_array, csr_array]:
    """A (n, n) and b (n, M + 1): point and pixel edges over the sum of both, row by row (step 4)."""
    edges, weights = _arrays("graph", graph), _arrays("labels", labels.weights)
    mass = numbers("labels.mass", labels.mass, np.float32, ("n",))
    a, (b, _) = _ldls.normalize_rows(edges, weights, mass)
    return _csr(a, graph.shape[1]), _csr(b, labels.weights.shape[1])


@overload
def diffuse(
    A: csr_array,
    b: csr_array,
    *,
    iterations: int | None = _BEST.iterations,
    every: None = None,
    threads: int | None = None,
) -> NDArray[np.float32]: ...


@overload
def diffuse(
    A: csr_array,
    b: csr_array,
    *,
    iterations: int | None = _BEST.iterations,
    every: int,
    threads: int | None = None,
) -> Iterator[NDArray[np.float32]]: ...


@checked
def diffuse(
    A: csr_array,
    b: csr_array,
    *,
    iterations: int | None = _BEST.iterations,
    every: int | None = None,
    threads: int | None = None,
) -> NDArray[np.float32] | Iterator[NDArray[np.float32]]:
    """Likelihoods (n, M + 1): z <- A z + b from z = 0, `iterations` times or, if None, until converged (step 5).

    With `every`, an iterator of them: those after `every`, 2 `every`, ... products, and after the last. The products
    are then run as they stand, in double precision, and no z is kept but the last; every array is the caller's own. On
    real frames with the paper's parameters the last differs from what is returned without `every`, a series in single
    precision, by at most 2e-5 of the largest likelihood of a point, and the largest is of the same label.

    Args:
        A: (n, n) of `normalize_rows`.
        b: (n, M + 1) of `normalize_rows`.
        iterations: Number of products. None with `every`: until one more changes no likelihood by more than 1e-5 and a
            hundredth of the largest of b, at most 20,000. On real frames the last is then within 1e-4 of the largest
            likelihood of the fixed point.
        every: Products from one array to the next, 1 or more.
        threads: As in `Params`. Results do not depend on it.
    """
    Params(iterations=iterations, threads=threads)
    edges, seeds = _arrays("A", A), _arrays("b", b)
    if every is None:
        # the pixel edges of a point weigh what its point edges leave
        mass = np.maximum(1.0 - A.astype(np.float64).sum(axis=1), 0.0).astype(np.float32)
        z, _, _ = _ldls.diffuse(edges, seeds, mass, b.shape[1], iterations, threads)
        return z
    every = whole_number("every", every, 1)
    products = _ldls.Products(edges, seeds, b.shape[1], iterations)
    return _as_it_happens(products, every, threads)


def _as_it_happens(products: _ldls.Products, every: int, threads: int | None) -> Iterator[NDArray[np.float32]]:
    while not products.finished:
        yield products.advance(every, threads)


@checked
def remove_outliers(
    graph: csr_array,
    labels: ArrayLike,
    *,
    points: ArrayLike | None = None,
    part_gap: float = _BEST.part_gap,
) -> NDArray[np.int32]:
    """`labels` (n,) with every point outside the largest component of its label turned into background (step 7).

    Args:
        graph: (n, n); its edges count as undirected.
        labels: (n,) 0 or more.
        points: (n, >= 3) in metres: keeps other components too that come within `part_gap` of the largest of a label.
        part_gap: As in `Params`.
    """
    array = numbers("labels", labels, np.int64, ("n",))
    if array.size and not 0 <= array.min() <= array.max() < 2**31:
        found = f"{array.min()} to {array.max()}"
        raise InputError(f"labels: got {found}, expected 0 or more; pass the points in view only")
    Params(part_gap=part_gap)
    xyz = np.empty((0, 3)) if points is None else _finite_xyz(points)
    if points is not None and len(xyz) != len(array):
        raise ShapeError(f"points: got {len(xyz)} rows, expected one a label, {len(array)}")
    gap = 0.0 if points is None else part_gap
    return _ldls.remove_outliers(_arrays("graph", graph), array.astype(np.uint32), xyz, gap)


@checked
def confidence(z: ArrayLike, labels: ArrayLike, masks: InstanceMasks) -> NDArray[np.float32]:
    """Probability (n,) that each label is of the right class, as fitted on simulated frames.

    Args:
        z: (n, M + 1) likelihoods of `diffuse`.
        labels: (n,) of `remove_outliers`, 0 to M.
        masks: The M masks, for their scores.
    """
    likelihoods = numbers("z", z, np.float32, ("n", len(masks) + 1))
    kept = numbers("labels", labels, np.uint32, (len(likelihoods),))
    if kept.max(initial=0) > len(masks):
        raise InputError(f"labels: got {kept.max()}, expected 0 to {len(masks)}")
    total = likelihoods.sum(axis=1)
    best = likelihoods.max(axis=1, initial=0)
    shares = np.divide(best, total, out=np.zeros_like(best), where=total > 0)
    return _ldls.confidence(shares, likelihoods.argmax(axis=1).astype(np.uint32), kept, masks.scores)


def _checked(depths: DepthGroups, points: int, masks: int) -> tuple[Any, Any, Any]:
    """The arrays of `depths`, which must be of so many points and of so many masks or more."""
    if len(depths.distances) != points or len(depths.unsure) != points or len(depths.intervals) < masks:
        raise ShapeError(
            f"depths: are of {len(depths.distances)} points and {len(depths.intervals)} masks, "
            f"expected {points} points and {masks} masks"
        )
    return depths.core


def _finite_xyz(points: ArrayLike) -> NDArray[np.float64]:
    xyz = np.ascontiguousarray(as_points(points)[:, :3], np.float64)
    if not np.isfinite(xyz).all():
        raise NonFiniteError("points: expected finite coordinates; leave other rows out first")
    return xyz


def _csr(arrays: tuple[Any, Any, Any], columns: int) -> csr_array:
    offsets, indices, values = arrays
    sparse = require("scipy.sparse", "eval")
    shape = (len(offsets) - 1, columns)
    return sparse.csr_array((values, indices, offsets), shape=shape)


def _arrays(name: str, matrix: csr_array) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]:
    if not require("scipy.sparse", "eval").issparse(matrix):
        raise DtypeError(f"{name}: expected a sparse matrix of SciPy, got {shown(matrix)}")
    if matrix.ndim != 2 or matrix.dtype.kind not in "fiu":
        raise ShapeError(f"{name}: expected a sparse matrix of numbers, got {matrix.dtype} {matrix.shape}")
    csr = matrix.tocsr()
    return (
        np.ascontiguousarray(csr.indptr, np.int64),
        np.ascontiguousarray(csr.indices, np.int32),
        np.ascontiguousarray(csr.data, np.float32),
    )
