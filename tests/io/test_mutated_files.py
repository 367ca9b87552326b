"""A few hundred changed files for each parser; `make fuzz-files` reads a million."""

import pytest

pytest.importorskip("laspy")
pytest.importorskip("lzf")
pytest.importorskip("onnx")
pytest.importorskip("rosbags")
pytest.importorskip("yaml")

from campaigns.file_parsers import PARSERS, Inputs

SLOW = {"bag": 20, "camera": 100}
"""Inputs of the parsers that take milliseconds, by the first word of their names."""


@pytest.mark.filterwarnings("ignore::ldls.errors.LdlsWarning")
@pytest.mark.parametrize("name", PARSERS)
def test_changed_files_are_read_or_refused(tmp_path, name):
    inputs, found = Inputs(name, 0), {}
    for number in range(SLOW.get(name.split()[0], 200)):
        found.setdefault(PARSERS[name].outcome(tmp_path, inputs[number]), number)
    assert found.keys() == {"accepted", "refused"}, f"{found}: the driver shows each by --seed 0 --only NUMBER"
