"""The simulated segmenter: each error does what it says, and none does nothing."""

import dataclasses

import numpy as np
import pytest

from ldls.errors import ParameterError
from ldls.simulation import PixelTruth, SegmenterErrors, SensorErrors, segmented, true_masks

NONE = SegmenterErrors.none()


@pytest.fixture(scope="module")
def truth() -> PixelTruth:
    """Twelve discs of one size, cars and people, and two cars side by side."""
    instances = np.zeros((300, 600), np.int32)
    v, u = np.mgrid[:300, :600]
    for m in range(12):
        row, column = 60 + 90 * (m // 6), 50 + 95 * (m % 6)
        instances[(v - row) ** 2 + (u - column) ** 2 <= 30**2] = m + 1
    instances[240:280, 100:140], instances[240:280, 140:180] = 13, 14
    categories = np.array([0, *[3, 1] * 6, 3, 3], np.int32)
    return PixelTruth(instances, categories[instances], np.bincount(instances.ravel())[1:].astype(float))


def found(truth, seed=0, **strengths):
    return segmented(truth, errors=dataclasses.replace(NONE, **strengths), seed=seed)


def overlap(masks, truth):
    silhouettes = true_masks(truth).to_array()
    return np.array([max((m & s).sum() / (m | s).sum() for s in silhouettes) for m in masks.to_array()])


def test_no_errors_change_nothing(truth):
    masks = segmented(truth, errors=NONE, seed=3)
    np.testing.assert_array_equal(masks.to_array(), [truth.instances == m for m in range(1, 15)])
    np.testing.assert_array_equal(masks.categories, [*[3, 1] * 6, 3, 3])
    assert (masks.scores == 1).all()


def test_a_seed_decides_the_masks(truth):
    one, same, other = (segmented(truth, seed=s).to_array() for s in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert one.shape != other.shape or not np.array_equal(one, other)


def test_coarse_masks_lose_detail(truth):
    fine, coarse = (overlap(found(truth, mask_cells=c), truth) for c in (28, 5))
    assert fine.min() > 0.94 > coarse.mean()


def test_boxes_that_slip_cut_masks_off(truth):
    assert overlap(found(truth, box_slip=0.1), truth).mean() < 0.97


@pytest.mark.parametrize("bleed_px", [1.0, 3.0])
def test_bleeding_enlarges_masks_by_so_many_pixels(truth, bleed_px):
    areas = [mask.area for seed in range(4) for mask in found(truth, seed=seed, bleed_px=bleed_px)][:12]
    radius = np.sqrt(np.array(areas) / np.pi)
    assert radius.mean() - 30 == pytest.approx(bleed_px, abs=0.4 * bleed_px)


def test_bleeding_by_cells_grows_with_the_object(truth):
    masks = found(truth, bleed_cells=1.0)
    assert np.sqrt(np.array([m.area for m in masks][:12]) / np.pi).mean() - 30 == pytest.approx(61 / 28, abs=1)


def test_ragged_edges_waver_both_ways(truth):
    masks, silhouettes = found(truth, ragged_px=2.0).to_array(), true_masks(truth).to_array()
    assert (masks & ~silhouettes).any(axis=(1, 2)).all()
    assert (silhouettes & ~masks).any(axis=(1, 2)).all()
    assert overlap(found(truth, ragged_px=2.0), truth).min() > 0.7


def test_missed_objects_are_that_share(truth):
    counts = [len(found(truth, seed=s, missed=0.3)) for s in range(40)]
    assert np.mean(counts) / 14 == pytest.approx(0.7, abs=0.08)


def test_small_and_hidden_objects_are_missed_more_often(truth):
    hidden = dataclasses.replace(truth, expected_px=4 * truth.expected_px)
    seen, less = (np.mean([len(found(t, seed=s, missed=0.15)) for s in range(40)]) for t in (truth, hidden))
    assert less < seen - 1


def test_merged_objects_share_a_mask(truth):
    masks = found(truth, merged=1.0)
    assert len(masks) == 13
    assert masks.to_array()[-1][240:280, 100:180].all()


def test_invented_objects_are_over_nothing(truth):
    extra = [len(found(truth, seed=s, invented=2.0)) - 14 for s in range(40)]
    assert np.mean(extra) == pytest.approx(2.0, abs=0.6)


def test_wrong_classes_are_that_share(truth):
    right = np.concatenate([found(truth, seed=s, wrong_class=0.4).categories for s in range(20)])
    assert np.isin(right, (1, 3)).mean() == pytest.approx(0.6, abs=0.1)


def test_scores_fall_with_their_noise(truth):
    assert found(truth, score_noise=0.2).scores.mean() < found(truth, score_noise=0.02).scores.mean() < 1


def test_masks_of_an_image_of_nothing():
    empty = PixelTruth(np.zeros((20, 30), np.int32), np.zeros((20, 30), np.int32), np.zeros(0))
    assert len(true_masks(empty)) == len(segmented(empty, errors=NONE)) == 0


@pytest.mark.parametrize(
    ("kind", "strengths"),
    [
        pytest.param(SegmenterErrors, {"missed": 1.2}, id="a probability above 1"),
        pytest.param(SegmenterErrors, {"bleed_px": -1.0}, id="a distance below 0"),
        pytest.param(SegmenterErrors, {"score_noise": np.nan}, id="not a number"),
        pytest.param(SensorErrors, {"rotation_deg": -0.1}, id="an angle below 0"),
        pytest.param(SensorErrors, {"delay_s": np.inf}, id="an infinite delay"),
    ],
)
def test_impossible_strengths_are_refused(kind, strengths):
    with pytest.raises(ParameterError, match=next(iter(strengths))):
        kind(**strengths)
