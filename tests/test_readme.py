"""The README's example runs, and its commands are what CI calls."""

import re
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def test_the_python_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    names = {}
    exec(example, names)
    assert "person" in capsys.readouterr().out
    assert (tmp_path / "frame.label").stat().st_size == 4 * len(names["points"])
    person = names["result"].labels[len(names["wall"]) :]
    assert (person == 1).mean() > 0.95
    assert np.isin(names["result"].labels[: len(names["wall"])], [-1, 0]).mean() > 0.9


def test_ci_runs_the_test_command_of_the_readme():
    assert "pip install '.[test]' && pytest" in README
    assert "pip install '.[test]' && pytest" in (ROOT / ".ci/run").read_text()
