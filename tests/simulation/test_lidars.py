"""Lidars fire along their beam tables, and err as they say."""

import dataclasses

import numpy as np
import pytest

from ldls.errors import ParameterError
from ldls.simulation import LIDARS, make_rig
from ldls.simulation.photograph import photograph
from ldls.simulation.raycasting import RayCaster
from ldls.simulation.rigs import CameraModel, MountedCamera
from ldls.simulation.scanning import scan
from ldls.simulation.scenes import Scene, make_scene
from ldls.simulation.shapes.primitives import box
from ldls.simulation.shapes.shape import Material


@pytest.mark.parametrize(
    ("name", "beams", "highest_deg", "lowest_deg", "steps_deg"),
    [
        pytest.param("hdl-64e", 64, 2.0, -24.8, {0.33, 0.5, 0.52}, id="HDL-64E: two blocks, 1/3 and 1/2 degree"),
        pytest.param("hdl-32e", 32, 10.67, -30.67, {1.33}, id="HDL-32E"),
        pytest.param("vlp-16", 16, 15.0, -15.0, {2.0}, id="VLP-16"),
        pytest.param("os1-128", 128, 22.5, -22.5, {0.35}, id="OS1-128"),
    ],
)
def test_beam_tables(name, beams, highest_deg, lowest_deg, steps_deg):
    table = np.array(LIDARS[name].elevations_deg)
    assert (len(table), table[0], table[-1]) == (beams, highest_deg, pytest.approx(lowest_deg))
    assert set(np.round(-np.diff(table), 2).tolist()) == steps_deg


@pytest.mark.parametrize("lidar", LIDARS.values(), ids=LIDARS.keys())
def test_directions_are_unit_vectors_at_the_elevations_of_their_rings(lidar):
    directions, rings = lidar.directions(), lidar.rings()
    assert directions.shape == (lidar.firings * len(lidar.elevations_deg), 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    np.testing.assert_allclose(np.degrees(np.arcsin(directions[:, 2])), np.array(lidar.elevations_deg)[rings])


@pytest.fixture(scope="module")
def street():
    scene = make_scene(4)
    return scene, RayCaster(scene.shape)


def sweep(street, **changes):
    lidar = dataclasses.replace(LIDARS["vlp-16"], **changes)
    return scan(*street, lidar, 1.0, np.random.default_rng(0))


def test_ranges_are_multiples_of_the_step(street):
    points = sweep(street, range_step_m=0.25).points.astype(float)
    steps = np.linalg.norm(points[:, :3], axis=1) / 0.25
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-4)


def test_noise_has_the_deviation_asked_for(street):
    sure = {"dropout": 0.0, "sensitivity": 1e9, "range_step_m": 0.0, "max_range_m": 60.0}
    exact = np.linalg.norm(sweep(street, range_noise_m=0.0, **sure).points[:, :3], axis=1)
    noisy = np.linalg.norm(sweep(street, range_noise_m=0.05, **sure).points[:, :3], axis=1)
    assert np.std(noisy - exact) == pytest.approx(0.05, rel=0.05)


def test_dropout_loses_that_share(street):
    full = len(sweep(street, dropout=0.0, sensitivity=1e9).points)
    assert len(sweep(street, dropout=0.4, sensitivity=1e9).points) == pytest.approx(0.6 * full, rel=0.03)


def test_far_returns_are_lost_first(street):
    sharp, dull = (sweep(street, sensitivity=s).points for s in (1e9, 0.5))
    lost = [
        1 - np.mean(_in(dull, *ring)) / np.mean(_in(sharp, *ring)) * len(dull) / len(sharp)
        for ring in ((2, 10), (20, 40))
    ]
    assert lost[1] > lost[0]


WALL_M, GREY = 5.0, 0.5
REFLECTANCE = 0.1 + 0.6 * GREY
COSINE_BANDS = np.array([0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0])


def wall(material=Material.PLAIN):
    """A long grey wall to the left of the lidar, seen ever more at a slant the farther along it a ray goes."""
    shape = box((0, WALL_M + 0.5, 0), (400, 1, 400), (GREY, GREY, GREY), material)
    scenery = np.zeros(len(shape.faces), np.int32)
    return Scene(shape, scenery, scenery, ())


def sweep_of_the_wall(**changes):
    """Points of many firings in one plane, and the cosine of the angle at which each meets the wall."""
    exact = {"elevations_deg": (0.0,), "firings": 200_000, "range_noise_m": 0.0, "range_step_m": 0.0, "dropout": 0.0}
    lidar = dataclasses.replace(LIDARS["vlp-16"], **exact, **changes)
    scene = wall()
    points = scan(scene, RayCaster(scene.shape), lidar, 1.0, np.random.default_rng(0)).points.astype(float)
    return points, WALL_M / np.linalg.norm(points[:, :3], axis=1), lidar


def test_intensity_falls_with_the_cosine_of_the_angle_of_incidence():
    points, cosine, _ = sweep_of_the_wall(sensitivity=1e9)
    bands = np.digitize(cosine, COSINE_BANDS)
    for k in range(1, len(COSINE_BANDS)):
        expected = REFLECTANCE * (0.35 + 0.65 * cosine[bands == k].mean())
        assert points[bands == k, 3].mean() == pytest.approx(expected, rel=0.02)


def test_grazed_surfaces_lose_returns_by_the_cosine():
    _, cosine, lidar = sweep_of_the_wall(sensitivity=0.02)
    seen = np.histogram(cosine, COSINE_BANDS)[0]
    slant = np.abs(lidar.directions()[:, 1])  # the wall's normal is y
    fired = (lidar.directions()[:, 1] > 0) & (WALL_M / np.maximum(slant, 1e-9) < lidar.max_range_m)
    signal = lidar.sensitivity * REFLECTANCE * slant * (lidar.max_range_m * slant / WALL_M) ** 2
    expected = np.histogram(slant[fired], COSINE_BANDS, weights=-np.expm1(-signal[fired]))[0]
    np.testing.assert_allclose(seen, expected, rtol=0.06)
    assert expected[0] < 0.1 * np.histogram(slant[fired], COSINE_BANDS)[0][0]


def test_glass_reflects_the_sky_where_it_is_grazed():
    camera = MountedCamera(CameraModel(400, 1, 120.0, (199.5, 0.0)), (0.0, 0.0, 0.0), yaw_deg=60.0)
    slant = (camera.model.directions() @ camera.T_camera_lidar()[:3, :3])[:, 1]
    brightness = {}
    for material in (Material.PLAIN, Material.GLASS):
        scene = wall(material)
        image, _ = photograph(scene, RayCaster(scene.shape), camera, 1.0)
        brightness[material] = image[0].mean(axis=1)
    gain = brightness[Material.GLASS] - brightness[Material.PLAIN]
    assert np.abs(gain[slant > 0.99]).max() < 1
    assert gain[(slant > 0.1) & (slant < 0.25)].min() > 6


def _in(points, near, far):
    distance = np.linalg.norm(points[:, :3], axis=1)
    return (distance >= near) & (distance < far)


def test_points_lie_on_their_rings(street):
    found = sweep(street, range_noise_m=0.0)
    rise = np.degrees(np.arcsin(found.points[:, 2] / np.linalg.norm(found.points[:, :3], axis=1)))
    np.testing.assert_allclose(rise, np.array(LIDARS["vlp-16"].elevations_deg)[found.rings], atol=1e-3)


@pytest.mark.parametrize(
    "changes",
    [{"dropout": 1.0}, {"min_range_m": 200.0}, {"firings": 0}, {"elevations_deg": ()}, {"sensitivity": np.nan}],
    ids=lambda changes: next(iter(changes)),
)
def test_impossible_lidars_are_refused(changes):
    with pytest.raises(ParameterError, match="lidar"):
        dataclasses.replace(LIDARS["vlp-16"], **changes)


def test_unknown_names_are_refused():
    with pytest.raises(ParameterError, match="hdl-64e"):
        make_rig(lidar="hdl-65")
    with pytest.raises(ParameterError, match="robot"):
        make_rig(camera="fisheye")
