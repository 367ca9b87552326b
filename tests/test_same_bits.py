"""Results do not depend on the number of threads, bit for bit; `make same-bits` looks at many more scenes and runs."""

import pytest

from campaigns import same_bits


@pytest.mark.parametrize(
    "seed", [pytest.param(0, id="one camera"), pytest.param(1, id="16 beams"), pytest.param(2, id="a ring")]
)
def test_a_scene_has_the_same_bits_over_threads_and_runs(seed):
    assert len(set(same_bits.digests(*same_bits.scene(seed), threads=same_bits.THREADS, runs=2))) == 1


def test_digests_tell_labels_apart():
    first, second = ({*same_bits.digests(*same_bits.scene(seed), threads=[1], runs=1)} for seed in (0, 1))
    assert first != second
