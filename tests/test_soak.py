"""Frame after frame in one process; `make soak` runs 20,000 and tells by how much memory grows."""

import sys

import numpy as np
import pytest

from campaigns import soak


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.filterwarnings("ignore::ldls.errors.NothingInView")
def test_frames_one_after_another_keep_no_memory():
    samples, refused = soak.soak(2000)
    # one frame in ten is broken, and none else is refused
    assert refused == 200
    # a kept cloud would be 36 KB a frame; allocators grow by 2 MB at a time, now and then
    assert soak.growth(samples) < 16 * soak.MOST_BYTES_A_FRAME


def test_every_mistake_of_the_soak_is_refused():
    generator = np.random.default_rng(1)
    assert not any(soak.label(10 * number + 3, generator) for number in range(8))


def test_growth_is_the_slope_of_the_memory():
    assert soak.growth([(500, 1000), (600, 3000), (700, 5000)]) == pytest.approx(20)
