"""The examples of docs/masks.md run, one after the other."""

import re
from pathlib import Path

DOC = (Path(__file__).parents[1] / "docs/masks.md").read_text()


def test_the_examples_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for example in re.findall(r"```python\n(.*?)```", DOC, re.DOTALL):
        exec(example, names)
        assert {len(names[masks]) for masks in {"masks", "boxes"} & names.keys()} <= {1, 2}
    assert capsys.readouterr().out == "['car', 'person']\n"
    assert [mask.area for mask in names["masks"]] == [20_000, 16_000]
    assert [mask.name for mask in names["cars_and_people"]] == ["person", "car", "car"]
