"""The whole method against the float64 oracle and the reference labels of real frames."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ldls
import oracle
from ldls import stages


@pytest.mark.parametrize("threads", [1, None], ids=["one thread", "all threads"])
def test_real_frames_get_the_reference_labels(kitti_frame, threads):
    frame = kitti_frame
    params = ldls.Params.paper(threads=threads)
    result = ldls.segment(frame.points, frame.masks, frame.camera, params=params)
    np.testing.assert_array_equal(result.in_view, frame.expected["in_view"])
    np.testing.assert_allclose(result.pixels, frame.expected["pixels"], atol=1e-9)
    in_view = result.in_view
    np.testing.assert_array_equal(result.diffused_labels[in_view], frame.expected["diffused"])
    np.testing.assert_array_equal(result.labels[in_view], frame.expected["labels"])
    z = frame.expected["likelihood"]
    np.testing.assert_allclose(result.confidence[in_view], z.max(axis=1) / z.sum(axis=1), atol=1e-4)


@pytest.mark.filterwarnings("ignore::ldls.errors.UprightWarning")
@pytest.mark.parametrize("added", [False, True], ids=["paper", "best"])
@pytest.mark.parametrize("seed", range(200))
@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_random_scenes_equal_the_oracle(seed, added):
    points, pixels, camera, params = random_scene(np.random.default_rng(seed), added)
    masks = ldls.InstanceMasks.from_array(pixels)
    result = ldls.segment(points, masks, camera, params=params)
    center = np.linalg.inv(camera.T_camera_lidar)[:3, 3]
    heights = ldls.stages.ground(points[result.in_view], camera, local_ground=params.local_ground)
    matrix = camera.projection @ camera.T_camera_lidar
    expected = oracle.segment(points, pixels, matrix, params, heights=heights if added else None, center=center)
    np.testing.assert_array_equal(result.in_view, expected.in_view)
    diffused = result.diffused_labels[result.in_view]
    best = expected.likelihood.max(axis=1, initial=0)
    value = np.take_along_axis(expected.likelihood, diffused[:, None], axis=1)[:, 0]
    # where two labels are equal but for the rounding of double precision, either is right; background too where what
    # comes is lost in the rounding of what others have
    right = best - value <= 1e-12 * best
    lost = best <= 1e-12 * expected.likelihood.max(initial=0)
    assert (right | (lost & (diffused == 0))).all()
    np.testing.assert_array_equal(result.labels[result.in_view], expected.remove_outliers(diffused, params))
    outside = np.ones(len(points), bool)
    outside[result.in_view] = False
    assert (result.labels[outside] == -1).all()
    assert (result.confidence[outside] == 0).all()


@pytest.mark.parametrize(("iterations", "n_clumps"), [(10, 0), (30, 0), (200, 80)])
def test_boxes_over_one_another_in_a_dense_cloud_equal_the_oracle(iterations, n_clumps):
    """Most of thousands of near-ties are told by seeds: far around, or in all of a clump, all labels have the same."""
    generator = np.random.default_rng(iterations)
    points = generator.uniform([-3, -2, 4], [3, 2, 8], (4000, 3))
    if n_clumps:
        points = points[np.arange(4000) % n_clumps] + generator.normal(0, 0.02, points.shape)
    camera = ldls.Camera(projection=[[60, 0, 60], [0, 60, 40], [0, 0, 1]], T_camera_lidar=np.eye(4))
    pixels = np.zeros((6, 80, 120), bool)
    for number, mask in enumerate(pixels):
        mask[5 + number : 75 - 2 * number, 10 : 60 + 10 * number] = True
    params = replace(ldls.Params.paper(), iterations=iterations)
    result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera, params=params)
    assert result.report.n_refined > 1100
    expected = oracle.segment(points, pixels, camera.projection @ camera.T_camera_lidar, params)
    check_winners(result, expected)


def check_winners(result, expected):
    """Each label before outlier removal has the largest likelihood, or one that rounding does not tell from it."""
    np.testing.assert_array_equal(result.in_view, expected.in_view)
    values = np.take_along_axis(expected.likelihood, result.diffused_labels[result.in_view, None], axis=1)[:, 0]
    best = expected.likelihood.max(axis=1)
    assert (best - values <= 1e-12 * best).all()


@pytest.mark.parametrize("apart_m", [4.5, 5.0])
def test_labels_that_a_far_neighbour_alone_tells_apart_equal_the_oracle(apart_m):
    """Of a thousand pairs each has two masks, one of them on the first point only: a spectrum of next to no width."""
    places = np.stack(np.meshgrid(25.0 * np.arange(35), 25.0 * np.arange(35)), axis=-1).reshape(-1, 2)
    first = np.column_stack([places, np.full(len(places), 100.0)])
    points = np.concatenate([first, first + np.array([apart_m, 0, 0])])
    camera = ldls.Camera(projection=[[400, 0, 10], [0, 400, 10], [0, 0, 1]], image_size=(3460, 3460))
    pixels = np.ones((2, 3460, 3460), bool)
    for column in np.unique(10 + 4 * (places[:, 0] + apart_m)).astype(int):
        pixels[0, :, column - 3 : column + 4] = False
    result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera, params=ldls.Params.paper())
    assert result.report.n_refined == len(places)
    assert (result.diffused_labels == 2).all()


def test_points_of_a_lattice_that_hardly_hang_together_equal_the_oracle():
    """The spectrum is narrow: a series on it alone would have rounding divided by its width."""
    generator = np.random.default_rng(1747)
    z = generator.uniform(2, 9, 300)
    rays = np.column_stack([generator.uniform(-0.7, 0.7, 300), generator.uniform(-0.45, 0.45, 300), np.ones(300)])
    points = np.round(4 * rays * z[:, None]) / 4
    camera = ldls.Camera(projection=[[40, 0, 30], [0, 40, 20], [0, 0, 1]], T_camera_lidar=np.eye(4))
    pixels = np.zeros((4, 40, 60), bool)
    pixels[:, 5:35, 5:55] = True
    for mask in pixels:
        row, column = generator.integers(0, 39), generator.integers(0, 59)
        mask[row : row + 2, column : column + 2] ^= True
    params = replace(ldls.Params.paper(), sigma=0.01, window=1, neighbors=2)
    result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera, params=params)
    check_winners(result, oracle.segment(points, pixels, camera.projection @ camera.T_camera_lidar, params))


@pytest.mark.parametrize("iterations", [200, 400])
@pytest.mark.parametrize("seed", [1, 28, 44, 46])
def test_points_of_a_line_whose_series_grows_equal_the_oracle(seed, iterations):
    """Their graph passes values on in one direction: its eigenvalues are complex, and terms of a series grow."""
    generator = np.random.default_rng(seed)
    points = np.array([0, 0, 4.0]) + generator.normal(size=(120, 1)) * [1, 0.3, 0.2]
    pixels = np.zeros((3, 60, 80), bool)
    for mask in pixels:
        left, right = sorted(generator.integers(0, 81, 2))
        mask[:, left:right] = True
    camera = ldls.Camera(projection=[[20, 0, 40], [0, 20, 30], [0, 0, 1]])
    params = replace(ldls.Params.paper(), neighbors=5, iterations=iterations)
    result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera, params=params)
    check_winners(result, oracle.segment(points, pixels, camera.projection @ camera.T_camera_lidar, params))


def random_scene(generator, added=False):
    """A scene with what goes wrong in life: overlapping and empty masks, points behind, missing and doubled; with the
    parameters of the paper's method or with those `added` to it too."""
    height, width = generator.integers(8, 60, 2)
    focal_px = generator.uniform(0.5, 1.5) * width
    camera = ldls.Camera(
        projection=[[focal_px, 0, width / 2, 3], [0, focal_px, height / 2, -2], [0, 0, 1, 0.01]],
        T_camera_lidar=random_transform(generator),
    )
    n = int(generator.integers(0, 400))
    scene = generator.normal(size=(n, 3)) * [4, 3, 6] + [0, 0, 8]
    to_lidar = np.linalg.inv(camera.T_camera_lidar)
    points = (scene @ to_lidar[:3, :3].T + to_lidar[:3, 3]).astype(generator.choice(["f4", "f8"]))
    if n:
        points[generator.integers(0, n, n // 5)] = points[generator.integers(0, n, n // 5)]
        points[generator.integers(0, n, n // 50), generator.integers(3)] = np.nan
    pixels = np.zeros((generator.integers(0, 6), height, width), bool)
    for mask in pixels:
        top, left = generator.integers(0, (height, width))
        # a side of 0 makes an empty mask
        mask[top : top + generator.integers(0, height), left : left + generator.integers(0, width)] = True
    extra = vars(ldls.Params.paper())
    if added:
        extra = {
            "ground_edges": generator.choice([0.0, 0.02, 1.0]),
            "ground_clearance": generator.choice([0.0, 0.1]),
            "local_ground": bool(generator.integers(2)),
            "depth_gap": generator.choice([0.0, 0.1, 0.6]),
            "bridged_gap": generator.choice([0.0, 1.5]),
            "edge_margin": generator.choice([0.0, 0.15]),
            "part_gap": generator.choice([0.0, 0.5, 1.5]),
        }
    own = dict(
        neighbors=int(generator.integers(1, 13)),
        sigma=generator.uniform(0.2, 2),
        pixel_weight=10 ** generator.uniform(-3, -1),
        window=int(generator.choice([1, 3, 5, 7])),
        iterations=int(generator.choice([1, 20, 200])),
        remove_outliers=bool(generator.integers(2)),
    )
    return points, pixels, camera, ldls.Params(**{**extra, **own})


def random_transform(generator):
    transform = np.eye(4)
    transform[:3, :3] = Rotation.random(rng=generator).as_matrix()
    transform[:3, 3] = generator.normal(size=3)
    return transform


@pytest.mark.parametrize(("neighbors", "iterations"), [(10, 500), (10, 1000), (20, 200), (20, 500)])
def test_where_rounding_grows_labels_equal_the_oracle(neighbors, iterations):
    """Density falls outwards by orders of magnitude, and single precision is off by up to a hundredth."""
    camera = ldls.Camera(projection=[[100, 0, 100], [0, 100, 60], [0, 0, 1]], T_camera_lidar=np.eye(4))
    params = replace(ldls.Params.paper(), neighbors=neighbors, iterations=iterations, remove_outliers=False)
    for seed in range(8):
        generator = np.random.default_rng(seed)
        radius, angle = 10 ** generator.uniform(-4, 0.5, 600), generator.uniform(0, 2 * np.pi, 600)
        points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(600, 8)]).astype(np.float32)
        pixels = np.zeros((60, 120, 200), bool)
        for mask in pixels:
            top, left, height, width = generator.integers([0, 0, 2, 2], [118, 198, 100, 100])
            mask[top : top + height, left : left + width] = True
        result = ldls.segment(points, ldls.InstanceMasks.from_array(pixels), camera, params=params)
        expected = oracle.segment(points, pixels, camera.projection @ camera.T_camera_lidar, params)
        check_winners(result, expected)


def test_results_are_the_same_bits_for_any_number_of_threads(frame_571):
    results = [
        ldls.segment(frame_571.points, frame_571.masks, frame_571.camera, params=ldls.Params(threads=threads))
        for threads in (1, 2, 3, 16)
    ]
    for other in results[1:]:
        assert other.confidence.tobytes() == results[0].confidence.tobytes()
        assert other.labels.tobytes() == results[0].labels.tobytes()
        assert other.pixels.tobytes() == results[0].pixels.tobytes()


def test_the_stages_together_equal_the_whole(frame_571):
    frame = frame_571
    in_view, pixels = stages.project(frame.points, frame.camera, image_size=frame.masks.image_size)
    heights = stages.ground(frame.points[in_view], frame.camera)
    depths = stages.depth_groups(frame.points[in_view], pixels, frame.masks, frame.camera, heights)
    rows = stages.in_graph(heights)
    assert 0.2 < len(rows) / len(in_view) < 0.9
    xyz, heights, pixels, depths = frame.points[in_view][rows], heights[rows], pixels[rows], depths.of_points(rows)
    indices, _ = stages.neighbors(xyz)
    graph = stages.point_graph(xyz, indices, heights=heights)
    A, b = stages.normalize_rows(graph, stages.pixel_labels(pixels, frame.masks, depths=depths))
    z = stages.diffuse(A, b)
    labels = stages.remove_outliers(A, z.argmax(axis=1), points=xyz)
    result = ldls.segment(frame.points, frame.masks, frame.camera)
    np.testing.assert_array_equal(labels, result.labels[in_view[rows]])
    confidence = stages.confidence(z, labels, frame.masks)
    np.testing.assert_allclose(confidence, result.confidence[in_view[rows]], atol=1e-5)
    others = np.delete(in_view, rows)
    assert not result.labels[others].any() and not result.diffused_labels[others].any()
    assert (result.confidence[others] > 0.99).all()


def test_the_stages_of_the_paper_equal_the_reference(frame_571):
    frame, paper = frame_571, ldls.Params.paper()
    in_view, pixels = stages.project(frame.points, frame.camera, image_size=frame.masks.image_size)
    indices, squared_distances = stages.neighbors(frame.points[in_view])
    assert (np.diff(squared_distances, axis=1) >= 0).all()
    graph = stages.point_graph(frame.points[in_view], indices, sigma=paper.sigma)
    A, b = stages.normalize_rows(graph, stages.pixel_labels(pixels, frame.masks))
    z = stages.diffuse(A, b, iterations=paper.iterations)
    np.testing.assert_array_equal(in_view, frame.expected["in_view"])
    np.testing.assert_allclose(z, frame.expected["likelihood"], atol=1e-5)
    labels = stages.remove_outliers(A, z.argmax(axis=1))
    np.testing.assert_array_equal(labels, frame.expected["labels"])


def test_the_converged_solution_is_the_fixed_point(small_scene):
    points, masks, camera = small_scene
    result = ldls.segment(points, masks, camera, params=ldls.Params(iterations=None))
    assert result.report.converged
    longer = ldls.segment(points, masks, camera, params=ldls.Params(iterations=20_000))
    np.testing.assert_allclose(result.confidence, longer.confidence, atol=2e-3)


def test_direct_projection_takes_the_label_of_the_nearest_pixel(small_scene):
    points, masks, camera = small_scene
    result = ldls.segment(points, masks, camera)
    direct = ldls.stages.direct_labels(result.pixels, masks)
    column, row = np.floor(result.pixels + 0.5).astype(int).T
    pixels = masks.to_array()
    expected = np.where(pixels[0, row, column], 1, np.where(pixels[1, row, column], 2, 0))
    np.testing.assert_array_equal(direct, expected)
