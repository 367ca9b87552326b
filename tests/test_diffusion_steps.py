"""`stages.diffuse(..., every=k)`: the likelihoods after every k products, against plain loops in double precision."""

import sys
from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array

import ldls
from ldls import _ldls, stages
from ldls.explaining import rebuild
from memory import resident_bytes


def system(seed, n=60, labels=4):
    """Random A and b of which each row sums to 1 together."""
    generator = np.random.default_rng(seed)
    A = generator.uniform(size=(n, n)) * (generator.uniform(size=(n, n)) < 0.1) + np.eye(n)
    b = generator.uniform(size=(n, labels)) * (generator.uniform(size=(n, labels)) < 0.3) * 0.01
    sums = (A.sum(axis=1) + b.sum(axis=1))[:, None]
    return csr_array((A / sums).astype(np.float32)), csr_array((b / sums).astype(np.float32))


def plain_loop(A, b, times):
    """z after each of `times` products."""
    A, b = A.astype(np.float64), b.toarray().astype(np.float64)
    z, found = np.zeros_like(b), {}
    for t in range(1, max(times) + 1):
        z = A @ z + b
        if t in times:
            found[t] = z
    return [found[t] for t in times]


@pytest.mark.parametrize(
    ("iterations", "every", "times"),
    [
        pytest.param(12, 4, [4, 8, 12], id="a multiple"),
        pytest.param(11, 4, [4, 8, 11], id="no multiple"),
        pytest.param(5, 1, [1, 2, 3, 4, 5], id="each product"),
        pytest.param(5, 5, [5], id="all at once"),
        pytest.param(5, 80, [5], id="more than there are"),
        pytest.param(1, 1, [1], id="one product"),
        pytest.param(200, np.int64(67), [67, 134, 200], id="a whole number of NumPy"),
    ],
)
@pytest.mark.parametrize("seed", range(4))
def test_each_array_is_that_of_the_plain_loop(seed, iterations, every, times):
    A, b = system(seed)
    found = list(stages.diffuse(A, b, iterations=iterations, every=every))
    assert len(found) == len(times)
    for z, expected in zip(found, plain_loop(A, b, times), strict=True):
        assert z.dtype == np.float32
        np.testing.assert_allclose(z, expected, rtol=1e-7)


def test_a_real_frame_ends_where_the_series_does(frame_571):
    paper = ldls.Params.paper()
    result = ldls.segment(frame_571.points, frame_571.masks, frame_571.camera, params=paper)
    system = rebuild(result)
    A, b = system.A, system.b
    *_, before, last = stages.diffuse(A, b, iterations=200, every=64)
    series = stages.diffuse(A, b, iterations=200)
    at_192, at_200 = plain_loop(A, b, [192, 200])
    # single precision ends at 1e-38
    np.testing.assert_allclose(before, at_192, rtol=1e-7, atol=1e-37)
    np.testing.assert_allclose(last, at_200, rtol=1e-7, atol=1e-37)
    largest = at_200.max(axis=1, keepdims=True)
    # it is the series that is not exact
    assert (np.abs(last - series) / largest).max() < 2e-5
    np.testing.assert_array_equal(last.argmax(axis=1), series.argmax(axis=1))
    np.testing.assert_array_equal(last.argmax(axis=1), frame_571.expected["diffused"])


def test_without_a_number_of_iterations_it_ends_where_one_more_changes_next_to_nothing():
    A, b = system(1)
    each = list(stages.diffuse(A, b, iterations=None, every=1))
    changes = [np.abs(after - before).max() for before, after in pairwise(each)]
    assert min(changes[:-1]) > 1e-5 >= changes[-1]
    by_seven = list(stages.diffuse(A, b, iterations=None, every=7))
    assert len(by_seven) == -(-len(each) // 7)
    np.testing.assert_array_equal(by_seven[0], each[6])
    np.testing.assert_array_equal(by_seven[-1], each[-1])


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_do_not_change_a_bit(threads):
    A, b = system(2, n=5000)
    one, other = (stages.diffuse(A, b, iterations=20, every=6, threads=count) for count in (1, threads))
    for z, same in zip(one, other, strict=True):
        assert z.tobytes() == same.tobytes()


def test_each_array_is_the_callers_own():
    A, b = system(3)
    expected = [z.copy() for z in stages.diffuse(A, b, iterations=6, every=2)]
    for z, kept in zip(stages.diffuse(A, b, iterations=6, every=2), expected, strict=True):
        np.testing.assert_array_equal(z, kept)
        z[:] = np.nan


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_does_not_grow_with_the_number_of_arrays():
    n, labels = 20_000, 50
    A, b = csr_array((np.full(n, 0.5, "f4"), (np.arange(n),) * 2)), csr_array(np.full((n, labels), 0.01, "f4"))
    of_one = n * labels * 4
    before = resident_bytes()
    for count, _ in enumerate(stages.diffuse(A, b, iterations=100, every=1), start=1):
        assert resident_bytes() - before < 25 * of_one, f"after {count} arrays"
    assert count == 100


@pytest.mark.parametrize(
    "every",
    [
        pytest.param(0, id="none"),
        pytest.param(-3, id="negative"),
        pytest.param(True, id="a bool"),
        pytest.param(2.0, id="a float"),
        pytest.param("5", id="text"),
    ],
)
def test_steps_that_are_none_are_refused_before_the_first_is_taken(every):
    with pytest.raises(ldls.ParameterError, match=r"^every: got .*, expected"):
        stages.diffuse(*system(0), every=every)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        pytest.param({"iterations": 0}, "iterations: got 0", id="iterations"),
        pytest.param({"threads": 0}, "threads: got 0", id="threads"),
    ],
)
def test_other_parameters_are_refused_as_early(options, message):
    with pytest.raises(ldls.ParameterError, match=message):
        stages.diffuse(*system(0), every=1, **options)


def test_seeds_of_another_graph_are_refused():
    (A, _), (_, b) = system(0), system(0, n=61)
    with pytest.raises(ldls.InputError, match="61 rows, the graph has 60"):
        stages.diffuse(A, b, every=1)


def test_points_without_labels_and_no_points_at_all():
    nothing = csr_array((0, 0), dtype=np.float32), csr_array((0, 3), dtype=np.float32)
    assert [z.shape for z in stages.diffuse(*nothing, iterations=4, every=2)] == [(0, 3)] * 2
    alone = csr_array(np.eye(2, dtype=np.float32)), csr_array((2, 3), dtype=np.float32)
    assert [z.any() for z in stages.diffuse(*alone, iterations=None, every=5)] == [False]


def test_likelihoods_beyond_what_the_pixel_edges_allow_are_computed_by_plain_products():
    # every pixel counts for two labels: likelihoods of a point sum to 2
    n = 300
    steps = np.arange(n)
    graph = (
        np.arange(n + 1) * 3,
        np.stack([steps, (steps + 1) % n, (steps - 1) % n], axis=1).ravel().astype("i4"),
        np.full(3 * n, 0.3, "f4"),
    )
    seeds = (np.arange(n + 1) * 2, np.tile([0, 1], n).astype("i4"), np.full(2 * n, 0.1, "f4"))
    allowed = _ldls.diffuse(graph, seeds, np.full(n, 0.1, "f4"), 2, 200, 1)
    beyond = _ldls.diffuse(graph, seeds, np.full(n, 0.2, "f4"), 2, 200, 1)
    assert allowed[1] < 200 == beyond[1]
    np.testing.assert_allclose(allowed[0], beyond[0], atol=1e-5)
    np.testing.assert_allclose(beyond[0].sum(axis=1), 2, atol=1e-5)


@pytest.mark.parametrize(
    ("drift", "masses", "shares"),
    [
        pytest.param(0.13, [0.2, 0.2, 0.02, 0.02], [0.5] * 100, id="sums beyond what the seeds allow"),
        pytest.param(0.11, [0.02], [0.25] * 2 + [0.0] * 98, id="negative likelihoods"),
    ],
)
def test_a_series_that_the_graph_leads_astray_is_given_up_for_products(drift, masses, shares):
    # a ring on which values flow more one way than the other; the signs of labels 0 and 1 cancel in the probe of errors
    n = 400
    mass, share = np.resize(masses, n), np.resize(shares, n)
    i = np.arange(n)
    flows = np.stack([np.full(n, 0.001), np.full(n, 0.999 * (0.5 + drift)), np.full(n, 0.999 * (0.5 - drift))], axis=1)
    columns = np.stack([i, (i + 1) % n, (i - 1) % n], axis=1)
    weights = (flows * (1 - mass)[:, None]).astype(np.float32)
    A = csr_array((weights.ravel(), columns.ravel(), 3 * np.arange(n + 1)), shape=(n, n))
    b = csr_array(np.repeat((mass * share)[:, None], 2, axis=1).astype(np.float32))
    (expected,) = plain_loop(A, b, [200])
    np.testing.assert_allclose(stages.diffuse(A, b, iterations=200), expected, atol=1e-5)
