"""Ray casting agrees with a slow intersection of every ray with every triangle."""

import numpy as np
import pytest

from ldls.simulation.raycasting import MISS, RayCaster
from ldls.simulation.shapes.primitives import ball, box
from ldls.simulation.shapes.shape import join


def slow_first_hits(shape, origin, directions):
    """Moeller and Trumbore's intersection, in double precision."""
    a, b, c = (shape.vertices_m[shape.faces[:, k]][None] for k in range(3))
    rays = directions[:, None]
    p = np.cross(rays, c - a)
    determinant = np.einsum("rfk,rfk->rf", np.broadcast_to(b - a, p.shape), p)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origin - a
        u = np.einsum("rfk,rfk->rf", np.broadcast_to(s, p.shape), p) / determinant
        q = np.cross(s, b - a)
        v = np.einsum("rfk,rfk->rf", np.broadcast_to(rays, p.shape), np.broadcast_to(q, p.shape)) / determinant
        t = np.einsum("rfk,rfk->rf", np.broadcast_to(c - a, p.shape), np.broadcast_to(q, p.shape)) / determinant
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return np.where(inside, t, np.inf).min(axis=1)


def test_ranges_equal_those_of_the_slow_intersection():
    shape = join([ball((8, 1, 0), (1, 2, 1), (1, 0, 0)), box((20, -3, 0), (2, 4, 6), (0, 1, 0))])
    directions = np.random.default_rng(0).normal((1, 0, 0), 0.2, (2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges, faces = RayCaster(shape).first_hits(np.zeros(3), directions)
    expected = slow_first_hits(shape, np.zeros(3), directions)
    same = np.isfinite(ranges) == np.isfinite(expected)
    assert same.mean() > 0.998  # a ray along an edge may go either way
    both = same & np.isfinite(ranges)
    assert both.sum() > 500
    assert np.quantile(np.abs(ranges[both] - expected[both]), 0.99) < 1e-6
    assert ((faces == MISS) == np.isinf(ranges)).all()


def test_a_ray_that_meets_nothing_has_infinite_range():
    ranges, faces = RayCaster(box((5, 0, 0), (1, 1, 1), (1, 1, 1))).first_hits(np.zeros(3), np.array([[-1.0, 0, 0]]))
    assert (ranges[0], faces[0]) == (np.inf, MISS)


@pytest.mark.parametrize("range_m", [0.5, 10.0, 100.0])
def test_range_to_a_wall_is_good_to_a_micrometre(range_m):
    wall = box((range_m + 0.5, 0, 0), (1, 400, 400), (1, 1, 1))
    ranges, _ = RayCaster(wall).first_hits(np.zeros(3), np.array([[1.0, 0, 0], [0.6, 0.8, 0]]))
    np.testing.assert_allclose(ranges, [range_m, range_m / 0.6], atol=1e-6)
