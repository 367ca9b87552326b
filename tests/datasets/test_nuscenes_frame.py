"""A key frame of nuScenes beside its files, with numbers that lie."""

import json

import numpy as np
import pytest

import ldls
from ldls.datasets import open_source


@pytest.fixture
def write(tmp_path):
    def write_frame(columns=("x", "y", "z", "intensity"), boxes=()):
        np.ones((3, 4), "<f4").tofile(tmp_path / "sweep.bin")
        frame = {
            "timestamp": 1.5,
            "lidar": {"file": "sweep.bin", "columns": columns},
            "cameras": {},
            "boxes_3d": [{"category": "car", "center_size_yaw": numbers} for numbers in boxes],
        }
        (tmp_path / "frame.json").write_text(json.dumps(frame))
        return tmp_path

    return write_frame


@pytest.mark.parametrize("columns", [["x"], "xyz", ["y", "x", "z", "intensity"], ["x", "y", "z"] + ["more"] * 62])
def test_columns_that_are_none_of_a_cloud_are_named_with_the_file(write, columns):
    with pytest.raises(ldls.CorruptFileError, match=r"frame\.json.*lidar\.columns: expected x, y, z and up"):
        open_source(write(columns))


def test_boxes_beyond_float64_hold_every_point_or_none(write):
    around, far = [1, 1, 1, 1e200, 1e200, 1e200, 0], [1e308, 1e308, 0, 1, 1, 1, 0.5]
    (frame,) = open_source(write(boxes=[around, far]))
    assert frame.truth.instances.tolist() == [1, 1, 1]
