"""Shapes have the size, and the gaps, of what they stand for."""

import numpy as np
import pytest

from ldls.simulation.raycasting import RayCaster
from ldls.simulation.shapes import figures, scenery, vehicles

SIZES_M = {
    vehicles.car: ((3.6, 5.0), (1.6, 1.95), (1.35, 1.75)),
    vehicles.bus: ((9.4, 12.3), (2.4, 2.7), (2.8, 3.3)),
    vehicles.truck: ((6.3, 9.4), (2.2, 2.7), (2.8, 3.6)),
    vehicles.bicycle: ((1.5, 1.9), (0.4, 0.65), (0.9, 1.2)),
    vehicles.motorcycle: ((1.8, 2.3), (0.6, 0.85), (0.9, 1.25)),
    figures.person: ((0.25, 1.3), (0.45, 0.9), (1.5, 2.05)),
    figures.dog: ((0.8, 1.5), (0.15, 0.35), (0.45, 1.0)),
    scenery.bench: ((0.4, 0.75), (1.4, 2.1), (0.7, 0.95)),
    scenery.chair: ((0.4, 0.65), (0.4, 0.6), (0.8, 1.05)),
    scenery.potted_plant: ((0.4, 1.6), (0.4, 1.6), (0.8, 2.0)),
}


@pytest.mark.parametrize("build", SIZES_M, ids=lambda build: build.__name__)
@pytest.mark.parametrize("seed", range(5))
def test_sizes_are_believable_and_shapes_stand_on_the_ground(build, seed):
    shape = build(np.random.default_rng(seed))
    for extent, (low, high) in zip(shape.size_m, SIZES_M[build], strict=True):
        assert low <= extent <= high
    assert shape.vertices_m[:, 2].min() == pytest.approx(0, abs=0.02)
    assert shape.faces.max() < len(shape.vertices_m)
    assert ((shape.colours >= 0) & (shape.colours <= 1)).all()


def across(shape, x_m, z_m):
    """True for each ray along y through (x, z) that meets the shape."""
    x, z = np.broadcast_arrays(np.asarray(x_m, float), np.asarray(z_m, float))
    origins = np.column_stack([x.ravel(), np.full(x.size, -9.0), z.ravel()])
    return RayCaster(shape).faces(origins, np.tile([0.0, 1.0, 0.0], (x.size, 1))) >= 0


def test_rays_pass_under_a_car_between_its_wheels_but_not_through_it():
    car = vehicles.car(np.random.default_rng(0))
    assert not across(car, [-0.2, 0.0, 0.2], 0.1).any()
    assert across(car, [-0.2, 0.0, 0.2], 0.5).all()


def test_rays_pass_under_a_lorry():
    assert not across(vehicles.truck(np.random.default_rng(0)), [-0.5, 0.0, 0.5], 0.4).any()


def test_rays_pass_between_the_legs_of_a_walker():
    walker = figures.person(np.random.default_rng(2), walking=True)
    column = across(walker, np.linspace(-0.5, 0.5, 101), 0.2)
    legs = np.flatnonzero(np.diff(column.astype(int)) == 1)
    assert len(legs) == 2
    assert across(walker, 0.0, 1.2).all()


def test_rays_pass_through_the_wheels_of_a_bicycle():
    bicycle = vehicles.bicycle(np.random.default_rng(0))
    wheel = across(bicycle, *np.meshgrid(np.linspace(0.7, 0.78, 9), np.linspace(0.28, 0.38, 9)))
    assert wheel.mean() < 0.3


@pytest.mark.parametrize("build", [scenery.bench, scenery.chair])
def test_rays_pass_under_seats(build):
    assert across(build(np.random.default_rng(0)), np.linspace(-0.1, 0.1, 9), 0.25).mean() < 0.3


def test_part_of_the_rays_pass_through_a_crown():
    tree = scenery.tree(np.random.default_rng(0))
    top = tree.vertices_m[:, 2].max()
    hit = across(tree, *np.meshgrid(np.linspace(-0.8, 0.8, 40), np.linspace(top - 2.5, top - 1, 40)))
    assert 0.3 < hit.mean() < 0.98
