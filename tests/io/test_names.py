"""The order of the names of files and frames."""

import pytest
from hypothesis import given, settings, strategies as st

from ldls.io.names import name_order


@pytest.mark.parametrize(
    "names",
    [
        pytest.param(["0", "1", "2", "9", "10", "11", "100"], id="without leading zeros"),
        pytest.param(["000009", "000010", "000100"], id="with leading zeros"),
        pytest.param(["a-2", "a1", "a1-b", "a2", "a10", "b1"], id="numbers within text"),
        pytest.param(["lidar2_frame9", "lidar2_frame10", "lidar10_frame1"], id="two numbers"),
        pytest.param(["9.5", "10.25", "10.5", "1547131046.25", "1547131046.5"], id="decimals"),
        pytest.param(["frame.9.png", "frame.10.png"], id="after a dot that is no decimal point"),
        pytest.param(["01", "1", "02", "2"], id="one number, written in two ways"),
        pytest.param(["", "9" * 30, "1" + "0" * 30, "a"], id="beyond 64 bits, and none"),
    ],
)
def test_names_are_in_the_order_of_their_numbers(names):
    assert sorted(sorted(names), key=name_order) == names


@settings(max_examples=300)
@given(st.lists(st.from_regex(r"[ab-]?[0-9]{4}[._][0-9]{3}", fullmatch=True), max_size=8))
def test_names_of_one_width_are_in_the_order_of_text(names):
    assert sorted(names, key=name_order) == sorted(names)
