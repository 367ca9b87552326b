"""Results do not depend on the number of threads, bit for bit; `make same-bits` looks at many more scenes and runs."""

import pytest

from campaigns import same_bits


@pytest.mark.parametrize("scene", same_bits.scenes(3), ids=["paper's camera", "16 beams", "a ring"])
def test_a_scene_has_the_same_bits_over_threads_and_runs(scene):
    assert len(set(same_bits.digests(*scene, threads=same_bits.THREADS, runs=2))) == 1


def test_digests_tell_labels_apart():
    first, second = same_bits.scenes(2)
    assert same_bits.digests(*first, threads=[1], runs=1) != same_bits.digests(*second, threads=[1], runs=1)
