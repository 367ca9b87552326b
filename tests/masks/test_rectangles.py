import numpy as np
import pytest
from hypothesis import given, strategies as st

import ldls

EDGE = st.one_of(st.integers(-3, 15).map(float), st.floats(-1e300, 1e300))


@given(boxes=st.lists(st.tuples(EDGE, EDGE, EDGE, EDGE), max_size=3), height=st.integers(1, 9), width=st.integers(1, 9))
def test_a_box_covers_the_pixels_whose_centres_it_holds(boxes, height, width):
    # the last, for all within 0 and 1 are refused
    boxes = [*((min(a, c), min(b, d), max(a, c), max(b, d)) for a, b, c, d in boxes), (0, 0, 2, 2)]
    masks = ldls.InstanceMasks.from_boxes(boxes, (height, width))
    v, u = np.mgrid[:height, :width]
    for mask, (left, top, right, bottom) in zip(masks, boxes, strict=True):
        inside = (u >= left) & (u <= right) & (v >= top) & (v <= bottom)
        np.testing.assert_array_equal(mask.to_array(), inside)
        dense = ldls.InstanceMasks.from_array([inside])[0]
        np.testing.assert_array_equal(mask.rle.runs(), dense.rle.runs())


def test_a_box_that_is_clipped_to_the_corner_of_its_image_is_none_of_shares():
    (mask,) = ldls.InstanceMasks.from_boxes([[0, 0, 0.8, 0.6]], (4, 5))
    assert mask.area == 1 and mask.to_array()[0, 0]


def test_boxes_have_categories_scores_and_names():
    masks = ldls.InstanceMasks.from_boxes([[0, 0, 3, 2]], (4, 5), categories=[104], scores=[0.5], names={104: "crane"})
    assert (masks[0].name, masks[0].score, masks[0].area) == ("crane", 0.5, 12)


@pytest.mark.parametrize(
    ("boxes", "size", "error", "message"),
    [
        pytest.param([[0, 0, 1, 1], [5, 0, 4, 1]], (4, 5), ldls.MaskError, "box 1: .*left <= right", id="turned"),
        pytest.param([[0, 0, np.nan, 1]], (4, 5), ldls.MaskError, "box 0: .*nan", id="NaN"),
        pytest.param([[0, 0, np.inf, 1]], (4, 5), ldls.MaskError, "box 0: .*inf", id="infinite"),
        pytest.param([[0, 0, 1, 1], [0.2, 0.3, 0.4, 0.9]], (4, 5), ldls.MaskError, "all 2 .* shares", id="shares"),
        pytest.param([[0.2, 0.3, 0.4, 0.9]], (4, 5), ldls.MaskError, "all 1 .* shares", id="shares of one box"),
        pytest.param([0, 0, 1, 1], (4, 5), ldls.MaskError, r"expected \(M, 4\)", id="one flat box"),
        pytest.param([[0, 0, 1e9, 1e9]], (2**30, 2**30), ldls.LimitError, "pixels", id="huge image"),
        pytest.param([[0, 0, 1, 1]], (-4, 5), ldls.MaskError, r"size is \(-4, 5\)", id="negative height"),
        pytest.param([[0, 0, 1, 1]], (4.0, 5), ldls.MaskError, "size is", id="height in floats"),
        pytest.param([[0, 0, 1, 1]], 4, ldls.MaskError, "size is 4", id="one side"),
    ],
)
def test_faults_of_boxes_are_named(boxes, size, error, message):
    with pytest.raises(error, match=message):
        ldls.InstanceMasks.from_boxes(boxes, size)
