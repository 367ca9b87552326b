"""Explanations of what the ground and the depth groups decide, against what the core did and plain loops."""

import json
from dataclasses import replace

import numpy as np
import pytest

import ldls
from ldls import stages
from ldls.explaining import rebuild, refused_labels
from ldls.simulation import sample_frame
from ring_samples import street_ring

SHARES = ldls.Params(calibrated=False, part_gap=0.9)
"""Confidence is the share of the winner, which an explanation says too, and not all parts of objects are kept."""


def one_camera():
    frame = sample_frame()
    (image,) = frame.images
    return ldls.segment(frame.points, image.masks, image.camera, params=SHARES)


@pytest.fixture(
    scope="module", params=[one_camera, lambda: ldls.segment(*street_ring(), params=SHARES)], ids=["camera", "ring"]
)
def street(request):
    result = request.param()
    return result, rebuild(result), {point: ldls.explain(result, point) for point in some_points(result)}


def some_points(result):
    """Points that keep an object, lose it, fall on a mask without getting its label, and stand beside one."""
    kinds = [result.labels > 0, result.labels < result.diffused_labels, result.direct_labels > result.labels]
    chosen = [np.flatnonzero(kind)[::59] for kind in kinds]
    for seen, depths in zip(result.views, rebuild(result).depths, strict=True):
        chosen.extend([] if depths is None else [seen.in_view[depths.unsure][::13]])
    return sorted({*np.concatenate(chosen).tolist()})


def test_every_lost_label_has_a_reason_and_no_other_point_has_one(street):
    result, system, explanations = street
    reasons = set()
    for point, found in explanations.items():
        removed = found.components is not None and found.components.removed
        assert removed == (result.labels[point] < result.diffused_labels[point])
        assert found.height_m == pytest.approx(system.heights[result.in_view.searchsorted(point)])
        assert found.cleared == (-0.3 < found.height_m < found.clearance_m == result.params.ground_clearance)
        assert found.cleared == (point not in system.in_graph) == (found.edges is None)
        if found.cleared:
            assert result.labels[point] == result.diffused_labels[point] == 0
            assert found.confidence == 1
            assert not found.neighbors and not found.likelihoods
            assert found.verdict.endswith("the ground, lower than 2 cm above it.")
        reasons.add("removed" if removed else "cleared" if found.cleared else "")
    assert reasons == {"removed", "cleared", ""}


def test_a_doubtful_label_is_left_out_for_its_doubt():
    sure = one_camera()
    doubtful = ldls.segment(sure.points, sure.masks, sure.views[0].view.camera, params=replace(SHARES, abstain=0.9))
    changed = np.flatnonzero(doubtful.labels != sure.labels)
    assert len(changed) and (doubtful.labels[changed] == 0).all()
    assert doubtful.abstained[changed].all()
    # what was background anyway, however doubtful, lost no label
    removed = (sure.labels == 0) & (sure.diffused_labels > 0)
    assert not np.any(np.delete(doubtful.abstained & ~removed, changed))
    assert np.any((doubtful.labels == 0) & (doubtful.diffused_labels == 0) & (doubtful.confidence < 0.9))
    found = ldls.explain(doubtful, int(changed[0]))
    assert found.verdict.endswith("only, less than 90.0 %.")
    assert not found.cleared


def test_components_keep_what_the_result_keeps(street):
    result, _, explanations = street
    for point, found in explanations.items():
        components = found.components
        if components is not None:
            assert components.keeps(components.own) == (result.labels[point] > 0)


def test_a_part_of_an_object_is_kept_beside_its_largest_component():
    alone = one_camera()
    result = ldls.segment(alone.points, alone.masks, alone.views[0].view.camera)
    # the truck behind a pole
    components = ldls.explain(result, 16999).components
    assert components.own > 0 and not components.removed
    assert 0.9 < components.gaps_m[components.own] < 1
    assert ldls.explain(alone, 16999).components.removed


def test_pixels_that_count_are_those_that_give_labels(street):
    result, system, explanations = street
    dropped = 0
    for point, found in explanations.items():
        if found.cleared:
            continue
        row = int(system.in_graph.searchsorted(point))
        labels = np.zeros(len(result.instances) + 1)
        for sight in found.sights:
            for each in sight.window:
                labels[each.label] += each.pixels * each.counts
                dropped += not each.counts
        weights = system.pixel_labels.weights[[row]].toarray()[0]
        np.testing.assert_allclose(labels * result.params.pixel_weight, weights, rtol=1e-5)
        pixels = sum(sight.window_pixels for sight in found.sights)
        mass = system.graph[[row]].sum() + system.pixel_labels.mass[row]
        assert found.edges.pixels == pytest.approx(pixels * result.params.pixel_weight / mass, rel=1e-2)
        assert found.winner.share == pytest.approx(result.confidence[point], abs=1e-5)
    assert dropped > 20


def test_windows_say_how_far_behind_an_object_a_point_is(street):
    result, system, explanations = street
    signs = set()
    for point, found in explanations.items():
        for sight, seen, depths in zip(found.sights, result.views, system.depths, strict=True):
            at = int(seen.in_view.searchsorted(point))
            for each in sight.window:
                if each.mask is None:
                    assert each.behind_m is None
                    assert each.counts != depths.unsure[at]
                    continue
                (near, far), distance = depths.intervals[each.mask], depths.distances[at]
                if np.isnan(near):
                    assert np.isnan(each.behind_m)
                    assert not each.counts
                    continue
                expected = distance - far if distance > far else distance - near if distance < near else 0.0
                assert each.behind_m == pytest.approx(expected)
                assert each.counts == (expected == 0)
                signs.add(np.sign(expected))
    assert signs == {-1, 0, 1}


def test_points_beside_masks_name_those_masks(street):
    result, system, explanations = street
    named = 0
    for number, (seen, depths) in enumerate(zip(result.views, system.depths, strict=True)):
        pixels = seen.view.masks.to_array()
        shorter = np.array([min(mask.bounding_box[2:]) for mask in seen.view.masks])
        reaches = np.clip((result.params.edge_margin * shorter).astype(int), 3, 10)
        # around the largest masks the core takes the whole of their box
        exact = seen.labels[reaches < 10].tolist()
        for at in np.flatnonzero(np.isin(seen.in_view, list(explanations))).tolist():
            column, row = np.floor(seen.pixels[at] + 0.5).astype(int)
            height = explanations[int(seen.in_view[at])].height_m
            standing, beside = not stages.GROUND_M[0] < height < stages.GROUND_M[1], []
            for mask, reach, (near, far) in zip(pixels, reaches.tolist(), depths.intervals, strict=True):
                around = mask[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]
                as_far = near <= depths.distances[at] <= far
                beside.append(standing and as_far and around.any() and not mask[row, column])
            found = explanations[int(seen.in_view[at])].sights[number].beside
            assert [label for label in found if label in exact] == [
                label for label in seen.labels[beside].tolist() if label in exact
            ]
            assert bool(found) == depths.unsure[at]
            named += bool(set(found) & set(exact))
    assert named > 3


def test_labels_that_depth_refuses_are_those_of_the_verdicts(street):
    result, _, explanations = street
    refused, said = refused_labels(result), 0
    for point, found in explanations.items():
        words = found.verdict.partition("outside the depth group of ")[2]
        if words:
            said += 1
            assert f"(label {refused[point]}), " in words
        elif result.labels[point] == result.diffused_labels[point]:
            assert refused[point] in (0, result.labels[point])
    assert said
    paper = ldls.segment(*street_ring(), params=ldls.Params.paper())
    assert not refused_labels(paper).any()


def test_edges_that_leave_the_ground_are_told_apart(street):
    result, system, explanations = street
    low = stages.on_ground(system.heights)
    leave = 0
    for point, found in explanations.items():
        row = int(result.in_view.searchsorted(point))
        for each in found.neighbors:
            other = int(result.in_view.searchsorted(each.point))
            assert each.leaves_ground == (low[row] != low[other])
            factor = result.params.ground_edges if each.leaves_ground else 1
            weight = factor * np.exp(-(each.distance_m**2) / result.params.sigma)
            assert each.weight == pytest.approx(weight, rel=1e-5)
            leave += each.leaves_ground
    assert leave


def test_results_of_the_paper_s_method_have_no_ground_and_no_depth():
    frame = sample_frame()
    (image,) = frame.images
    result = ldls.segment(frame.points, image.masks, image.camera, params=ldls.Params.paper())
    for point in some_points(result)[::8]:
        found = ldls.explain(result, point)
        assert (found.height_m, found.clearance_m, found.cleared) == (None, 0, False)
        assert not any(each.leaves_ground for each in found.neighbors)
        assert all(each.counts and each.behind_m is None for sight in found.sights for each in sight.window)
        assert "depth group" not in found.verdict


def test_plain_values_hold_what_decided(street):
    found = next(each for each in street[2].values() if "outside the depth group" in each.verdict)
    read = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert read["height_m"] == found.height_m and read["clearance_m"] == found.clearance_m
    windows = [each for sight in read["sights"] for each in sight["window"]]
    assert any(each["behind_m"] and not each["counts"] for each in windows)
