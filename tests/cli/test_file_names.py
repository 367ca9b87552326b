"""Files whose names are long, or no text, as commands see them."""

import os
import subprocess
import sys

import pytest


def ldls(*words):
    command = [os.fsencode(sys.executable), b"-m", b"ldls", *map(os.fsencode, words)]
    return subprocess.run(command, capture_output=True, check=False)


@pytest.mark.skipif(sys.platform != "linux", reason="names are text here")
def test_a_name_that_is_no_text(tmp_path):
    source = tmp_path / os.fsdecode(b"caf\xe9")
    source.mkdir()
    outcome = ldls("info", source)
    assert outcome.returncode == 1
    assert outcome.stderr.startswith(b"error: ")
    assert b"caf\\udce9" in outcome.stderr
    assert b"Traceback" not in outcome.stderr


@pytest.mark.parametrize("command", [["info"], ["run", "--masks", ".", "--out", "out"]], ids=["info", "run"])
def test_a_name_longer_than_any_file_has(tmp_path, command):
    outcome = ldls(command[0], tmp_path / ("x" * 300), *command[1:])
    assert outcome.returncode != 0
    assert b"xxx" in outcome.stderr
    assert b"Traceback" not in outcome.stderr


def test_a_folder_of_results_with_a_name_too_long_is_named(tmp_path):
    outcome = ldls("demo", "--out", tmp_path / ("x" * 300))
    assert outcome.returncode == 1
    assert outcome.stderr.startswith(b"error: ")
    assert b"xxx" in outcome.stderr
    assert not list(tmp_path.iterdir())
