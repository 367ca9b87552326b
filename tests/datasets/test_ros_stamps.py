"""Nearest stamps."""

import pytest
from hypothesis import given, strategies as st

from ldls.datasets.ros_stamps import StampedMessage, nearest
from ldls.io.ros.messages import Header

STAMPS = st.lists(st.integers(0, 2**62), max_size=8)


def stamped(stamps):
    return [StampedMessage("/points", Header(stamp, "lidar"), stamp, rank) for rank, stamp in enumerate(sorted(stamps))]


@given(STAMPS, STAMPS.filter(bool))
def test_the_nearest_is_that_of_a_plain_search(stamps, others):
    for stamp in stamps:
        found = nearest(stamped(others), stamp).header.stamp_ns
        assert abs(found - stamp) == min(abs(other - stamp) for other in others)


@pytest.mark.parametrize("others", [[10, 30], [10, 10, 30], [-10, 10, 30, 50]], ids=["two", "twice", "among others"])
def test_of_two_equally_near_ones_the_earlier_is_taken(others):
    messages = stamped(others)
    assert nearest(messages, 20).header.stamp_ns == 10
    assert nearest(messages, 21).header.stamp_ns == 30
    assert nearest(messages, 10) is messages[others.index(10)]
