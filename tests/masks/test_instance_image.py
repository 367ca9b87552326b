import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

import ldls
from mask_samples import random_masks


@given(
    arrays(
        st.sampled_from([np.uint8, np.uint16, np.int32, np.uint64]),
        st.tuples(st.integers(1, 12), st.integers(1, 12)),
        elements=st.integers(0, 5),
    )
)
def test_each_number_is_a_mask(image):
    masks = ldls.InstanceMasks.from_instance_image(image)
    numbers = [value for value in np.unique(image) if value]
    np.testing.assert_array_equal(masks.to_array(), np.array([image == n for n in numbers]).reshape(-1, *image.shape))
    dense = np.searchsorted([0, *numbers], image)
    again = masks.to_instance_image()
    np.testing.assert_array_equal(again, dense)
    assert again.dtype == np.uint8


@pytest.mark.parametrize("seed", range(20))
def test_masks_become_numbers(seed):
    masks = random_masks(seed).resolve_overlaps()
    expected = (masks.to_array() * np.arange(1, len(masks) + 1)[:, None, None]).sum(axis=0)
    np.testing.assert_array_equal(masks.to_instance_image(), expected)


def test_runs_without_pixels_overlap_nothing():
    results = [
        {"category_id": 1, "segmentation": {"size": [4, 5], "counts": [0, 8, 12]}},
        {"category_id": 1, "segmentation": {"size": [4, 5], "counts": [3, 0, 17]}},
    ]
    assert ldls.InstanceMasks.from_coco(results).to_instance_image().sum() == 8


def test_numbers_need_not_be_small_or_dense():
    image = np.array([[0, 2**40], [2**63, 70_000]], np.uint64)
    masks = ldls.InstanceMasks.from_instance_image(image)
    np.testing.assert_array_equal(masks.to_array(), [image == 70_000, image == 2**40, image == 2**63])


def test_values_of_a_class_that_is_named_background_are_no_masks():
    values = np.array([[1 * 256 + 1, 2 * 256 + 1, 0]], np.uint16)
    masks = ldls.InstanceMasks.from_instance_image(values, class_divisor=256, names={1: "background", 2: "car"})
    assert [mask.name for mask in masks] == ["car"]


def test_cityscapes_divides_by_1000():
    image = np.array([[26_001, 26_002], [24_000, 7]], np.int32)
    masks = ldls.InstanceMasks.from_instance_image(image * (image > 999), class_divisor=1000)
    assert [(mask.category, mask.name, mask.area) for mask in masks] == [(26, "class 26", 1)] * 2


@pytest.mark.parametrize(
    ("image", "options", "error", "message"),
    [
        pytest.param(np.zeros((4, 5)), {}, ldls.MaskError, "expected whole numbers, got float64", id="floats"),
        pytest.param(np.zeros((4, 5, 3), int), {}, ldls.MaskError, r"expected \(height, width\)", id="three channels"),
        pytest.param(np.zeros((0, 5), int), {}, ldls.MaskError, r"got shape \(0, 5\)", id="no rows"),
        pytest.param(np.array([[0, -1]]), {}, ldls.MaskError, r"pixel \(0, 1\) is -1", id="-1"),
        pytest.param(np.array([[1, 2]]), {"categories": [1]}, ldls.MaskError, "one for each of 2", id="too few"),
        pytest.param(np.array([[1]]), {"class_divisor": 1}, ldls.ParameterError, "got 1, expected 2", id="divisor 1"),
        pytest.param(
            np.array([[1]]),
            {"class_divisor": 256, "categories": 1},
            ldls.ParameterError,
            "no categories beside it",
            id="both",
        ),
    ],
)
def test_faults_of_instance_images_are_named(image, options, error, message):
    with pytest.raises(error, match=message):
        ldls.InstanceMasks.from_instance_image(image, **options)
