"""Four real sweeps in a row: a car rolls up to a queue at a traffic light. Masks are boxes set by hand."""

import shutil

import numpy as np
import pytest
from scipy.spatial import KDTree

import ldls
from ldls.datasets import odometry_of, open_source

pytest.importorskip("kiss_icp", reason="the extra odometry is not installed")

CATEGORIES = np.array([3, 8, 3, 3, 3])
FIRST_BOXES = np.array(
    [[62, 182, 414, 375], [347, 148, 508, 262], [556, 184, 702, 314], [686, 179, 740, 215], [500, 167, 540, 218]]
)
LAST_BOXES = np.array(
    [[0, 184, 398, 375], [330, 147, 502, 270], [557, 186, 704, 318], [688, 180, 742, 217], [495, 169, 540, 220]]
)
"""A car and a lorry that wait on the left, the car ahead, which rolls, and two cars farther on; between them evenly."""
AHEAD = 2


@pytest.fixture(scope="module")
def real_drive(data_folder):
    folder = data_folder / "real/kitti_raw/2011_09_26"
    if not folder.is_dir():
        pytest.skip("LDLS_TEST_DATA has no folder real/kitti_raw")
    return open_source(folder)


@pytest.fixture(scope="module")
def way(real_drive):
    return odometry_of(real_drive)


def across_the_way(first, other):
    """Distances of standing points of one sweep to faces across the way of another, the car ahead left out."""
    tree = KDTree(first)
    _, near = tree.query(first, 12)
    off = first[near] - first[near].mean(axis=1, keepdims=True)
    extents, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", off, off) / 12)
    normals = axes[:, :, 0]
    faces = (extents[:, 0] < 0.03**2) & (extents[:, 1] > 9 * extents[:, 0]) & (np.abs(normals[:, 0]) > 0.7)
    distances, nearest = tree.query(other)
    fits = (distances < 1) & faces[nearest] & ~((np.abs(other[:, 1]) < 1.3) & (other[:, 0] > 3) & (other[:, 0] < 20))
    return np.abs(np.sum((other - first[near].mean(axis=1)[nearest]) * normals[nearest], axis=1))[fits]


TURN_S = 0.1035


@pytest.fixture(scope="module")
def timed_drive(real_drive, tmp_path_factory):
    """The same sweeps with the times at which they begin and end, as KITTI's drives have them."""
    day = shutil.copytree(real_drive.path.parent, tmp_path_factory.mktemp("timed") / real_drive.path.parent.name)
    for name, later_s in (("", 0), ("_start", -TURN_S / 2), ("_end", TURN_S / 2)):
        lines = [f"2011-09-26 13:02:{25.5 + TURN_S * k + later_s:.9f}\n" for k in range(4)]
        (day / real_drive.path.name / f"velodyne_points/timestamps{name}.txt").write_text("".join(lines))
    return open_source(day)


def placed(way, source):
    """Points of each sweep that stand near by, in the lidar's frame and in the world."""
    clouds = []
    for pose, frame in zip(way.poses, source, strict=True):
        xyz = frame.deskewed(way).points[:, :3].astype(float)
        xyz = xyz[(xyz[:, 2] > -0.73) & (np.linalg.norm(xyz, axis=1) < 30)]
        clouds.append((xyz, xyz @ pose[:3, :3].T + pose[:3, 3]))
    return clouds


def test_what_stands_still_in_real_sweeps_coincides(real_drive, way):
    """Rear ends of cars that wait, and walls: they show how far the car rolled, 0.74 m; the car ahead rolls too."""
    clouds = placed(way, real_drive)
    distances, _ = KDTree(clouds[0][1]).query(clouds[3][1])
    assert np.median(distances) < 0.05
    apart = across_the_way(clouds[0][1], clouds[3][1])
    assert len(apart) > 500 and np.median(apart) < 0.05
    assert np.median(across_the_way(clouds[0][0], clouds[3][0])) > 0.05, "lines alone would coincide, too"


def test_it_does_so_where_points_have_times(timed_drive):
    """At 2.3 m/s a sweep has 12 cm of motion to each side of its stamp, nearly the same in all four."""
    clouds = placed(odometry_of(timed_drive), timed_drive)
    distances, _ = KDTree(clouds[0][1]).query(clouds[3][1])
    assert np.median(distances) < 0.03
    assert np.median(across_the_way(clouds[0][1], clouds[3][1])) < 0.06, "0.696 m and 0.685 m of 0.74 m"


CLOSING_M = 0.27
"""By so much a car behind comes nearer from sweep to sweep."""


@pytest.mark.parametrize("number", range(4))
def test_a_car_that_follows_has_an_even_front_where_a_sweep_begins_and_ends(timed_drive, number):
    """Its left half, where a sweep begins, is a turn older than its right half: so the lidar turns clockwise."""
    frame = timed_drive[number]
    x, y, z = frame.points[:, :3].T
    front = (x > -16) & (x < -13.8) & (z > -0.97) & (z < -0.78)
    left, right = front & (y > 0.3) & (y < 0.6), front & (y > -0.86) & (y < -0.56)
    assert left.sum() > 10 and right.sum() > 10
    nearer = np.eye(4)
    nearer[0, 3] = CLOSING_M
    # as seen from that car, the lidar backs up to it
    as_seen = ldls.Trajectory([frame.stamp - TURN_S, frame.stamp], [nearer, np.eye(4)])
    again = as_seen.deskew(frame.points, frame.times, frame.stamp)[:, 0]
    assert np.median(x[right]) - np.median(x[left]) == pytest.approx(CLOSING_M, abs=0.03)
    assert np.median(again[right]) - np.median(again[left]) == pytest.approx(0, abs=0.03)


def boxes_of(real_drive, way):
    """Sweeps with masks, which stand in another order in each image, and that order."""
    generator = np.random.default_rng(0)
    for number, frame in enumerate(real_drive):
        order = generator.permutation(len(CATEGORIES))
        boxes = FIRST_BOXES + (LAST_BOXES - FIRST_BOXES) * number / 3
        image = frame.images[0]
        masks = ldls.InstanceMasks.from_boxes(boxes[order], image.read().shape[:2], categories=CATEGORIES[order])
        yield ldls.Sweep(frame.points, [ldls.View(masks, image.camera)], way.poses[number], way.stamps[number]), order


@pytest.mark.parametrize("window", [pytest.param(4, id="all together"), pytest.param(2, id="two and two")])
def test_cars_keep_their_tracks(real_drive, way, window):
    sweeps, orders = zip(*boxes_of(real_drive, way), strict=True)
    tracker, results = ldls.Tracker(), []
    for start in range(0, 4, window):
        some = sweeps[start : start + window]
        results += tracker.track(some, ldls.segment_sweeps(some))
    tracks, places = np.zeros((4, 5), int), np.zeros((4, 5, 3))
    for number, (sweep, result, order) in enumerate(zip(sweeps, results, orders, strict=True)):
        for instance, thing in zip(result.instances, result.objects, strict=True):
            for _, mask in instance.sources:
                tracks[number, order[mask]] = instance.track
                places[number, order[mask]] = sweep.pose[:3, :3] @ thing.centroid + sweep.pose[:3, 3]
    assert (tracks == tracks[0]).all() and len(set(tracks[0].tolist())) == 5 and tracks.all()
    moved = np.linalg.norm(places[3, :, :2] - places[0, :, :2], axis=1)
    assert 0.4 < moved[AHEAD] < 0.7
    assert np.delete(moved, AHEAD).max() < 0.2
