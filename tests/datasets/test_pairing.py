"""Nearest stamps."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ldls.datasets.pairing import nearest

STAMPS = st.lists(st.integers(0, 2**62), max_size=8)


@given(STAMPS, STAMPS)
def test_the_nearest_is_that_of_a_plain_search(stamps, others):
    found = nearest(np.array(stamps, np.int64), np.array(others, np.int64))
    for stamp, index in zip(stamps, found.tolist(), strict=True):
        if others:
            assert abs(others[index] - stamp) == min(abs(other - stamp) for other in others)
        else:
            assert index == -1
