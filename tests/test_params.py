from dataclasses import replace

import numpy as np
import pytest

import ldls


def test_the_papers_parameters_add_nothing_to_its_method():
    params = ldls.Params.paper()
    assert (params.neighbors, params.sigma, params.pixel_weight) == (10, 1.0, 0.001)
    assert (params.window, params.iterations, params.remove_outliers) == (5, 200, True)
    assert (params.ground_edges, params.ground_clearance, params.local_ground) == (1.0, 0.0, False)
    assert (params.depth_gap, params.bridged_gap, params.edge_margin, params.part_gap) == (0.0, 0.0, 0.0, 0.0)
    assert ldls.Params.paper(threads=2) == replace(params, threads=2)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("neighbors", 0),
        ("neighbors", -1),
        ("neighbors", 2.5),
        ("neighbors", 10**9),
        ("neighbors", True),
        ("sigma", 0.0),
        ("sigma", -1.0),
        ("sigma", float("nan")),
        ("sigma", "wide"),
        ("sigma", "1.0"),
        ("sigma", 10**400),
        ("sigma", True),
        ("pixel_weight", 0.0),
        ("pixel_weight", 1e-44),
        ("pixel_weight", float("inf")),
        ("window", 4),
        ("window", 0),
        ("window", 103),
        ("iterations", 0),
        ("iterations", 10**9),
        ("iterations", "many"),
        ("threads", 0),
        ("threads", 10**6),
        ("remove_outliers", 1),
        ("local_ground", 0),
        ("ground_edges", 1.5),
        ("ground_edges", -0.1),
        ("ground_clearance", 2.0),
        ("ground_clearance", None),
        ("depth_gap", -1.0),
        ("depth_gap", float("inf")),
        ("bridged_gap", float("nan")),
        ("edge_margin", "wide"),
        ("part_gap", -1),
    ],
)
def test_values_out_of_range_are_refused_by_name(name, value):
    with pytest.raises(ldls.ParameterError, match=f"^{name}: ") as caught:
        ldls.Params(**{name: value})
    assert isinstance(caught.value, ValueError)
    assert caught.value.code == "parameter"


def test_an_unknown_parameter_is_a_type_error():
    with pytest.raises(TypeError, match="neighbours"):
        ldls.Params(neighbours=10)


def test_numpy_numbers_are_numbers():
    params = ldls.Params(neighbors=np.int64(5), sigma=np.float32(2), iterations=np.uint8(7))
    assert params.neighbors == 5


@pytest.mark.parametrize("value", ["0", "many", "-2", ""])
def test_a_bad_environment_variable_is_named(monkeypatch, value):
    monkeypatch.setenv("LDLS_NUM_THREADS", value)
    with pytest.raises(ldls.ParameterError, match="LDLS_NUM_THREADS"):
        ldls.Params()


def test_the_environment_sets_the_threads(monkeypatch):
    monkeypatch.setenv("LDLS_NUM_THREADS", "3")
    assert ldls._ldls.default_threads() == 3
