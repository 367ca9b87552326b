"""Files whose names are long, or no text, as commands see them."""

import os
import sys

import pytest

from command import process


@pytest.mark.skipif(sys.platform != "linux", reason="names are text here")
def test_a_name_that_is_no_text(tmp_path):
    source = tmp_path / os.fsdecode(b"caf\xe9")
    source.mkdir()
    outcome = process("info", source)
    assert outcome.returncode == 1
    assert outcome.stderr.startswith("error: ")
    assert "caf\\udce9" in outcome.stderr
    assert "Traceback" not in outcome.stderr


@pytest.mark.parametrize("command", [["info"], ["run", "--masks", ".", "--out", "out"]], ids=["info", "run"])
def test_a_name_longer_than_any_file_has(tmp_path, command):
    outcome = process(command[0], tmp_path / ("x" * 300), *command[1:])
    assert outcome.returncode != 0
    assert "xxx" in outcome.stderr
    assert "Traceback" not in outcome.stderr


def test_a_folder_of_results_with_a_name_too_long_is_named(tmp_path):
    outcome = process("demo", "--out", tmp_path / ("x" * 300))
    assert outcome.returncode == 1
    assert outcome.stderr.startswith("error: ")
    assert "xxx" in outcome.stderr
    assert not list(tmp_path.iterdir())
