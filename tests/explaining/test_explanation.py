"""Explanations of points against loops in double precision, and the words they use."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls.explaining import Explanation
from ldls.explaining.rebuilt import rebuild
from ldls.simulation import Drive, drive_frame
from ring_samples import as_views, random_ring

PARAMS = replace(ldls.Params.paper(), neighbors=6, sigma=0.3, pixel_weight=0.01, iterations=40)


@pytest.fixture(scope="module", params=[0, 7], ids="ring {}".format)
def ring(request):
    points, views = random_ring(request.param)
    return points, views, ldls.segment(points, as_views(views), params=PARAMS)


@pytest.fixture(scope="module")
def system(ring):
    return plain_system(*ring)


def some_points(result):
    """Points of all kinds: that keep an instance, lose it, are background, and are seen by two cameras."""
    kinds = (result.labels > 0, result.labels < result.diffused_labels, result.diffused_labels == 0)
    twice = Counter(np.concatenate([seen.in_view for seen in result.views]).tolist())
    chosen = [np.flatnonzero(kind)[::37] for kind in kinds]
    return sorted({*np.concatenate(chosen).tolist(), *[point for point, n in twice.items() if n > 1][::29]})


def squared_distance(a, b):
    return sum((float(p) - float(q)) ** 2 for p, q in zip(a, b, strict=True))


def plain_neighbors(points, in_view, point):
    others = [(squared_distance(points[j], points[point]), j) for j in in_view.tolist() if j != point]
    return sorted(others)[: PARAMS.neighbors]


def plain_window(pixels, uv):
    """Pixels of the window that each mask covers, background first, and how many there are."""
    column, row = (int(np.floor(x + 0.5)) for x in uv)
    counts, total = [0] * (len(pixels) + 1), 0
    for y in range(row - 2, row + 3):
        for x in range(column - 2, column + 3):
            if 0 <= y < pixels.shape[1] and 0 <= x < pixels.shape[2]:
                covering = [m for m, mask in enumerate(pixels) if mask[y, x]]
                total += 1
                counts[0] += not covering
                for m in covering:
                    counts[m + 1] += 1
    return counts, total


def plain_system(points, views, result):
    """The rows of A and b as lists of dictionaries, and the weights before they were normalised."""
    edges, seeds, rows = {}, {}, {}
    for point in result.in_view.tolist():
        near = plain_neighbors(points, result.in_view, point)
        edges[point] = {point: 1.0} | {j: float(np.exp(-d2 / PARAMS.sigma)) for d2, j in near}
        labels, total = Counter(), 0
        for (pixels, _, camera), seen in zip(views, result.views, strict=True):
            uv = plain_pixel(camera, points[point], pixels.shape[1:])
            if uv is not None:
                counts, in_image = plain_window(pixels, uv)
                total += in_image
                for instance, count in enumerate(counts):
                    labels[int(seen.labels[instance - 1]) if instance else 0] += count * PARAMS.pixel_weight
        rows[point] = sum(edges[point].values()) + total * PARAMS.pixel_weight
        seeds[point] = labels
    return edges, seeds, rows


def plain_pixel(camera, xyz, size):
    u, v, w = camera.projection @ camera.T_camera_lidar @ [*xyz, 1.0]
    if w <= camera.min_depth_m:
        return None
    u, v = u / w, v / w
    return (u, v) if 0 <= np.floor(u + 0.5) < size[1] and 0 <= np.floor(v + 0.5) < size[0] else None


def plain_likelihoods(edges, seeds, rows, n_labels):
    z = {point: [0.0] * n_labels for point in edges}
    for _ in range(PARAMS.iterations):
        after = {}
        for point, own in edges.items():
            after[point] = [seeds[point][m] / rows[point] for m in range(n_labels)]
            for j, weight in own.items():
                for m, value in enumerate(z[j]):
                    after[point][m] += weight / rows[point] * value
        z = after
    return z


def plain_components(edges, members):
    """Sets of points that edges join, the direction not counting, the largest first."""
    left, found = set(members), []
    while left:
        reached = [left.pop()]
        for point in reached:
            joined = {j for j in left if j in edges[point] or point in edges[j]}
            left -= joined
            reached.extend(joined)
        found.append(set(reached))
    return sorted(found, key=lambda component: (-len(component), min(component)))


def test_everything_equals_plain_loops(ring, system):
    points, _, result = ring
    edges, seeds, rows = system
    z = plain_likelihoods(edges, seeds, rows, len(result.instances) + 1)
    islands = plain_components(edges, list(edges))
    for point in some_points(result):
        found = ldls.explain(result, point)
        assert (found.label, found.diffused_label) == (result.labels[point], result.diffused_labels[point])
        near = plain_neighbors(points, result.in_view, point)
        assert [each.point for each in found.neighbors] == [j for _, j in near]
        for each, (d2, j) in zip(found.neighbors, near, strict=True):
            assert each.distance_m == pytest.approx(d2**0.5)
            assert each.weight == pytest.approx(np.exp(-d2 / PARAMS.sigma), rel=1e-5)
            assert each.share == pytest.approx(edges[point][j] / rows[point], rel=1e-5)
            assert (each.label, each.diffused_label) == (result.labels[j], result.diffused_labels[j])
        assert found.edges.own == pytest.approx(1 / rows[point], rel=1e-6)
        pixels = rows[point] - sum(edges[point].values())
        assert found.edges.pixels == pytest.approx(pixels / rows[point], abs=1e-6)
        assert found.edges.own + found.edges.neighbors + found.edges.pixels == pytest.approx(1)
        expected = {label: value for label, value in enumerate(z[point]) if value > 0 or label == found.diffused_label}
        assert {each.label: each.value for each in found.likelihoods} == pytest.approx(expected, rel=1e-5)
        assert (np.diff([each.value for each in found.likelihoods]) <= 0).all()
        assert sum(each.share for each in found.likelihoods) == pytest.approx(1)
        assert found.winner.share == pytest.approx(result.confidence[point], abs=1e-5)
        (island,) = (island for island in islands if point in island)
        assert (found.island.points, found.island.islands) == (len(island), len(islands))


def test_components_equal_plain_loops(ring, system):
    _, _, result = ring
    edges, _, _ = system
    removed = 0
    for point in some_points(result):
        found = ldls.explain(result, point).components
        if result.diffused_labels[point] == 0:
            assert found is None
            continue
        members = np.flatnonzero(result.diffused_labels == result.diffused_labels[point]).tolist()
        expected = plain_components(edges, members)
        assert found.sizes == tuple(len(component) for component in expected)
        assert point in expected[found.own]
        assert found.removed == (result.labels[point] == 0) == (found.own > 0)
        removed += found.removed
    assert removed


def test_sights_equal_plain_loops(ring):
    points, views, result = ring
    seen_twice = 0
    for point in [*some_points(result), *np.flatnonzero(result.labels < 0)[:20].tolist()]:
        sights = ldls.explain(result, point).sights
        assert [sight.camera for sight in sights] == ["camera 0", "camera 1", "camera 2"]
        for sight, seen, (pixels, _, camera) in zip(sights, result.views, views, strict=True):
            w = (camera.projection @ camera.T_camera_lidar @ [*points[point], 1.0])[2]
            assert sight.depth_m == pytest.approx(w)
            uv = plain_pixel(camera, points[point], pixels.shape[1:])
            if uv is None:
                assert sight.outcome == ("outside" if w > 0.1 else "behind")
                assert (sight.window, sight.window_pixels, sight.direct_label) == ((), 0, None)
                continue
            assert sight.outcome == "in view"
            assert sight.pixel == pytest.approx(uv)
            column, row = sight.nearest_pixel
            assert (column, row) == tuple(int(np.floor(x + 0.5)) for x in uv)
            counts, total = plain_window(pixels, uv)
            expected = [(instance - 1 if instance else None, n) for instance, n in enumerate(counts) if n]
            assert [(each.mask, each.pixels) for each in sight.window] == expected
            assert [each.label for each in sight.window] == [0 if m is None else seen.labels[m] for m, _ in expected]
            assert sight.window_pixels == total
            on = [m for m, mask in enumerate(pixels) if mask[row, column]]
            assert sight.direct_label == (seen.labels[on[0]] if on else 0)
        seen_twice += sum(sight.outcome == "in view" for sight in sights) > 1
    assert seen_twice


def test_a_point_outside_an_image_has_the_pixel_it_would_have():
    camera = ldls.Camera(projection=[[40, 0, 30], [0, 40, 20], [0, 0, 1]])
    masks = ldls.InstanceMasks.from_array(np.ones((1, 40, 60), bool))
    result = ldls.segment(np.array([[0, 0, 5.0], [4, -1, 2.0]]), masks, camera)
    (sight,) = ldls.explain(result, 1).sights
    assert (sight.outcome, sight.depth_m, sight.pixel) == ("outside", 2.0, (110.0, 0.0))


def lens():
    return ldls.Camera(
        projection=[[40, 0, 30], [0, 40, 20], [0, 0, 1]],
        distortion=ldls.Distortion("plumb_bob", [-0.4, 0, 0, 0, 0]),
    )


def pinhole():
    return ldls.Camera(projection=[[40, 0, 30], [0, 40, 20], [0, 0, 1]])


@pytest.mark.parametrize(
    ("xyz", "camera", "outcome", "words"),
    [
        pytest.param([0, 0, -3], pinhole, "behind", "behind the camera, at a depth of -3.00 m", id="behind"),
        pytest.param([0, 0, 0.05], pinhole, "behind", "at a depth of 0.05 m", id="nearer than the smallest depth"),
        pytest.param([9, 0, 4], pinhole, "outside", "at u 120.0, v 20.0, outside the image of 40 x 60", id="beside"),
        pytest.param([9, 0, 0.5], lens, "beyond the lens", "beyond the lens of the camera", id="beyond the lens"),
        pytest.param([0, np.nan, 4], pinhole, "not finite", "a coordinate is not finite", id="NaN"),
        pytest.param([np.inf, 0, 4], pinhole, "not finite", "a coordinate is not finite", id="infinite"),
        pytest.param([0, 0, 0], pinhole, "origin", "stands for a missing return", id="origin"),
    ],
)
def test_points_out_of_view_are_told_why(xyz, camera, outcome, words):
    masks = ldls.InstanceMasks.from_array(np.ones((1, 40, 60), bool))
    found = ldls.explain(ldls.segment(np.array([[0, 0, 5.0], xyz]), masks, camera()), 1)
    assert found.label == -1
    assert [sight.outcome for sight in found.sights] == [outcome]
    assert found.verdict.startswith("Point 1 is out of view: ")
    assert words in found.verdict
    assert (found.neighbors, found.likelihoods, found.winner, found.components) == ((), (), None, None)


def test_the_origin_is_a_point_as_any_other_where_it_was_kept():
    masks = ldls.InstanceMasks.from_array(np.ones((1, 40, 60), bool))
    result = ldls.segment(np.array([[0, 0, 5.0], [0, 0, 0]]), masks, pinhole(), keep_origin=True)
    assert ldls.explain(result, 1).sights[0].outcome == "behind"


def test_every_camera_of_a_ring_says_why_it_does_not_see_a_point(ring):
    points, views, _ = ring
    result = ldls.segment(np.vstack([points, [[0, 0, -9.0]]]), as_views(views), params=PARAMS)
    verdict = ldls.explain(result, len(points)).verdict
    assert verdict == (
        f"Point {len(points)} is out of view: no camera sees it; it is behind camera 0, camera 1 and camera 2."
    )
    aside = ldls.segment(np.vstack([points, [[-20, 0, 0.0]]]), as_views(views), params=PARAMS)
    assert ldls.explain(aside, len(points)).verdict.endswith(
        "it is behind camera 1 and camera 2; it is outside the image of camera 0."
    )


def test_verdicts_are_sentences_with_both_sizes(ring):
    _, _, result = ring
    for point in some_points(result):
        found = ldls.explain(result, point)
        name = {0: "background"}.get(found.diffused_label, f"(label {found.diffused_label})")
        assert str(found) == found.verdict
        assert name in found.verdict
        if found.components and found.components.removed:
            own, largest = found.components.sizes[found.components.own], found.components.sizes[0]
            if own < largest:
                assert f"component of {own} point" in found.verdict
                assert f"the largest has {largest}: removed" in found.verdict
        elif found.runner_up is None:
            assert "no other label reached it" in found.verdict
        else:
            assert f"{100 * found.winner.share:.1f} % of its likelihood" in found.verdict


def explanation(**changes):
    from ldls.explaining import Likelihood

    fields = {
        "point": 7, "xyz": (1.0, 2.0, 3.0), "label": 1, "diffused_label": 1, "sights": (),
        "names": {-1: "out of view", 0: "background", 1: "car"},
        "likelihoods": (Likelihood(label=1, value=0.5, share=1.0),),
        "components": components(5, own=0),
    }  # fmt: skip
    return Explanation(**fields | changes)


def components(*sizes, own, gap_m=1.0, part_gap=0.0):
    from ldls.explaining import Components

    gaps_m = (0.0, *(gap_m for _ in sizes[1:]))
    return Components(label=1, sizes=sizes, gaps_m=gaps_m, own=own, removal=True, part_gap=part_gap)


def sight(direct_label, *window, **changes):
    from ldls.explaining import Sight, WindowCount

    counts = tuple(
        WindowCount(label=m, mask=m - 1 if m else None, pixels=9, counts=not b, behind_m=b) for m, b in window
    )
    return Sight(
        camera="c", outcome="in view", image_size=(9, 9), depth_m=8.0, pixel=(3.0, 4.0), nearest_pixel=(3, 4),
        direct_label=direct_label, window_pixels=25, window=counts, **changes,
    )  # fmt: skip


def likelihoods(*values):
    from ldls.explaining import Likelihood

    total = sum(values) or 1
    return tuple(Likelihood(label=1 - i, value=value, share=value / total) for i, value in enumerate(values))


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        pytest.param({}, "Point 7 is car (label 1): no other label reached it.", id="alone"),
        pytest.param(
            {"label": 0, "components": components(5, 5, 1, own=1)},
            "Point 7 is background: diffusion gave it to car (label 1), but it lies in a component of 5 points, "
            "as large as the one kept, which has the lowest row: removed.",
            id="as large as the kept one",
        ),
        pytest.param(
            {"label": 0, "components": components(5, 5, 1, own=2)},
            "Point 7 is background: diffusion gave it to car (label 1), but it lies in a component of 1 point, "
            "the largest has 5: removed.",
            id="one point",
        ),
        pytest.param(
            {"likelihoods": likelihoods(0.3, 0.1)},
            "Point 7 is car (label 1): 75.0 % of its likelihood, background comes next with 25.0 %.",
            id="ahead",
        ),
        pytest.param(
            {"likelihoods": likelihoods(0.9999, 0.0001)},
            "Point 7 is car (label 1): 100.0 % of its likelihood, background comes next with < 0.1 %.",
            id="far ahead",
        ),
        pytest.param(
            {"likelihoods": likelihoods(0.2, 0.2)},
            "Point 7 is car (label 1): 50.0 % of its likelihood, background has as much.",
            id="a tie",
        ),
        pytest.param(
            {"likelihoods": likelihoods(0.2, 0.199998)},
            "Point 7 is car (label 1): 50.0 % of its likelihood, background comes next, 1.0e-05 of that behind.",
            id="nearly a tie",
        ),
        pytest.param(
            {"likelihoods": likelihoods(0.0), "label": 1},
            "Point 7 is car (label 1): no label reached it.",
            id="nothing",
        ),
        pytest.param(
            {"label": 0, "components": components(1200, 85, own=1, part_gap=1.5, gap_m=2.34)},
            "Point 7 is background: diffusion gave it to car (label 1), but it lies in a component of 85 points, "
            "2.34 m from the largest, which has 1,200: removed.",
            id="too far for a part",
        ),
        pytest.param(
            {"components": components(1200, 18, own=1, part_gap=1.5, gap_m=1.5)},
            "Point 7 is car (label 1): no other label reached it.",
            id="a part",
        ),
        pytest.param(
            {"label": 0, "diffused_label": 0, "components": None, "height_m": 0.0396, "clearance_m": 0.04},
            "Point 7 is background: it is 3.9 cm above the ground, lower than 4 cm above it.",
            id="near the ground",
        ),
        pytest.param(
            {"label": 0, "diffused_label": 0, "components": None, "height_m": -0.12, "clearance_m": 0.055},
            "Point 7 is background: it is 12 cm below the ground, lower than 5.5 cm above it.",
            id="below the ground",
        ),
        pytest.param(
            {"label": 0, "diffused_label": 0, "components": None, "sights": (sight(1, (0, None), (1, 7.94)),)},
            "Point 7 is background: no label reached it; it is outside the depth group of car (label 1), 7.9 m "
            "behind it.",
            id="behind the object",
        ),
        pytest.param(
            {"label": 0, "diffused_label": 0, "components": None, "sights": (sight(1, (1, -0.04)),) * 2},
            "Point 7 is background: no label reached it; it is outside the depth group of car (label 1), less than "
            "0.1 m before it.",
            id="before the object, said once",
        ),
        pytest.param(
            {"sights": (sight(0, (0, None), (1, -1.2)),)},
            "Point 7 is car (label 1): no other label reached it.",
            id="beside a mask that does not count",
        ),
    ],
)
def test_rare_verdicts(changes, verdict):
    assert explanation(**changes).verdict == verdict


def test_without_outlier_removal_nothing_is_removed(ring):
    points, views, result = ring
    kept = ldls.segment(points, as_views(views), params=replace(PARAMS, remove_outliers=False))
    point = int(np.flatnonzero(result.labels < result.diffused_labels)[0])
    found = ldls.explain(kept, point)
    assert found.components.own > 0
    assert not found.components.removed
    assert "removed" not in found.verdict


@pytest.mark.parametrize("iterations", [1, 7, 40, None])
def test_influences_times_seeds_are_likelihoods(ring, iterations):
    from ldls.explaining import influences, rebuild

    _, _, result = ring
    system = rebuild(result)
    z = ldls.stages.diffuse(system.A, system.b, iterations=iterations)
    for row in (0, 100, 500):
        np.testing.assert_allclose(influences(system.A, row, iterations) @ system.b, z[row], rtol=2e-3, atol=1e-6)


def test_provenance_is_where_the_pixels_are_that_decide(ring):
    from ldls.explaining import rebuild

    points, _, result = ring
    point = int(np.flatnonzero(result.labels > 0)[9])
    found, system = ldls.explain(result, point), rebuild(result)
    # the seeds of one point after another alone
    row = int(np.searchsorted(result.in_view, point))
    A, b = system.A.toarray().astype(float), system.b.toarray().astype(float)[:, found.diffused_label]
    # the point's row of the powers of A, and of their sum
    power, total = np.eye(len(A))[row], np.zeros(len(A))
    for _ in range(PARAMS.iterations):
        total += power
        power = power @ A
    parts = total * b
    assert found.provenance.own_share == pytest.approx(parts[row] / parts.sum(), rel=1e-9)
    distances = np.linalg.norm(points[result.in_view] - points[point], axis=1)
    half = found.provenance.half_within_m
    assert parts[distances <= half + 1e-12].sum() >= parts.sum() / 2 > parts[distances < half - 1e-12].sum()


def test_a_real_frame_explains_its_labels(frame_571):
    result = ldls.segment(frame_571.points, frame_571.masks, frame_571.camera, params=ldls.Params.paper())
    z = frame_571.expected["likelihood"]
    for row in range(0, len(result.in_view), 4001):
        found = ldls.explain(result, int(result.in_view[row]))
        values = np.zeros(z.shape[1])
        values[[each.label for each in found.likelihoods]] = [each.value for each in found.likelihoods]
        np.testing.assert_allclose(values, z[row], atol=1e-5)
        assert found.likelihoods[0].label == found.diffused_label


def test_what_next_to_nothing_comes_to_is_background_in_the_explanation_too():
    # the lines of this lidar are metres apart far away
    frame = drive_frame(Drive(n_frames=1, seed=7003, lidar="vlp-16"), 0)
    result = ldls.segment(frame.points, frame.images[0].masks, frame.images[0].camera)
    system = rebuild(result)
    A, b = system.A.astype(np.float64), system.b.astype(np.float64).toarray()
    z = np.zeros_like(b)
    for _ in range(result.params.iterations):
        z = A @ z + b
    faint = np.flatnonzero((z.max(axis=1) > 0) & (z.max(axis=1) < 1e-15))
    assert len(faint) > 10 and z[faint].argmax(axis=1).any()
    for row in faint:
        found = ldls.explain(result, int(system.in_graph[row]))
        assert (found.label, found.diffused_label) == (0, 0)
        assert [(each.label, each.value) for each in found.likelihoods] == [(0, 0.0)]


def test_clouds_next_to_nothing_can_be_explained():
    masks = ldls.InstanceMasks.from_array(np.ones((1, 40, 60), bool), names={1: "thing"}, categories=[1])
    found = ldls.explain(ldls.segment(np.array([[0, 0, 5.0]]), masks, pinhole()), 0)
    assert found.neighbors == ()
    assert found.verdict == "Point 0 is thing (label 1): no other label reached it."
    assert found.edges.own + found.edges.pixels == pytest.approx(1)


@pytest.mark.parametrize(
    ("point", "message"),
    [
        pytest.param(-1, "got -1, expected 0 to 839", id="negative"),
        pytest.param(840, "got 840, expected 0 to 839", id="beyond the last"),
        pytest.param(1.0, "got 1.0, expected a whole number", id="a float"),
        pytest.param(True, "got True, expected", id="a bool"),
        pytest.param("5", "got '5', expected a whole number", id="text"),
    ],
)
def test_rows_that_are_none_are_refused(ring, point, message):
    with pytest.raises(ldls.ParameterError, match=message):
        ldls.explain(ring[2], point)


def test_without_a_camera_every_point_is_out_of_view():
    found = ldls.explain(ldls.segment(np.array([[0, 0, 5.0]]), []), 0)
    assert found.verdict == "Point 0 is out of view: there is no camera."


def test_an_empty_cloud_has_no_point_to_explain():
    masks = ldls.InstanceMasks.from_array(np.ones((1, 40, 60), bool))
    with pytest.raises(ldls.ParameterError, match="the cloud is empty"):
        ldls.explain(ldls.segment(np.zeros((0, 3)), masks, pinhole()), 0)


def test_explanations_are_equal_and_have_one_hash_where_all_they_say_is(ring):
    _, _, result = ring
    points = result.in_view[:20].tolist()
    found = {ldls.explain(result, point) for point in points + points}
    assert sorted(each.point for each in found) == sorted(points)


def test_plain_values_go_through_json(ring):
    points, views, result = ring
    point = int(result.in_view[5])
    found = ldls.explain(result, point)
    read = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert read["verdict"] == found.verdict
    assert read["names"]["0"] == "background"
    assert [each["point"] for each in read["neighbors"]] == [each.point for each in found.neighbors]
    lost = ldls.segment(np.vstack([points, [[np.nan, 1, 2]]]), as_views(views), params=PARAMS)
    assert ldls.explain(lost, len(points)).to_dict()["xyz"] == [None, 1.0, 2.0]
