"""The example of docs/rings.md runs, and says what its comments say."""

import re
from pathlib import Path

DOC = (Path(__file__).parents[1] / "docs/rings.md").read_text()


def test_the_example_runs(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", DOC, re.DOTALL)
    names = {}
    exec(example, names)
    result = names["result"]
    assert result.sources == (((0, 0), (1, 0)),)
    assert (result.labels[: len(names["car"])] == 1).mean() > 0.9
    assert "left" in capsys.readouterr().out
