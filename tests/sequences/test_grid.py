"""Numbers of cells."""

import re

import numpy as np
import pytest

import ldls
from ldls.sequences.grid import FARTHEST, cell_keys


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_cells_have_numbers_of_their_own_to_the_last(axes):
    ends = np.array([-FARTHEST, -1, -0.5, 0, 0.5, 1, FARTHEST])
    points = np.stack(np.meshgrid(*[ends] * axes), axis=-1).reshape(-1, axes)
    numbers = {}
    for cell, key in zip(np.floor(points).tolist(), cell_keys(points, 1.0).tolist(), strict=True):
        numbers.setdefault(tuple(cell), set()).add(key)
    assert len(numbers) == 5**axes and {len(keys) for keys in numbers.values()} == {1}
    assert len(set.union(*numbers.values())) == 5**axes


@pytest.mark.parametrize("far", [FARTHEST + 1.0, -FARTHEST - 1.0, 1e300, np.inf])
def test_what_is_too_far_to_be_numbered_is_refused(far):
    with pytest.raises(ldls.LimitError, match=re.escape("expected at most 1.04858e+06 m with cells of 1 m")):
        cell_keys(np.array([[0, far, 0]]), 1.0)
