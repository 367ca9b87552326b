"""The guide's example runs."""

import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
pytest.importorskip("embreex")

from ldls.datasets import RosBag
from ldls.simulation import write_robot_drive

GUIDE = (Path(__file__).parents[2] / "docs/ros.md").read_text()


def test_from_a_bag_to_a_labelled_bag(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_robot_drive("robot", "mcap", frames=2)
    example = next(code for code in re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL) if "import ldls" in code)
    names = {}
    exec(example, names)
    labelled = RosBag("robot/labelled", points_topic="/points_labelled")
    assert len(labelled) == 2
    np.testing.assert_array_equal(labelled.cloud(1).fields["class_id"], names["result"].categories)
