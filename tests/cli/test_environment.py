"""Commands where the environment has nonsense in it, or the locale no letters but ASCII."""

import json
import os
import subprocess
import sys

import pytest
from typer.main import get_command

from ldls.cli import app
from ldls.errors import ParameterError
from ldls.simulation import suite_folder

COMMANDS = [(), *((name,) for name in get_command(app).commands)]
ASCII = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C", "PYTHONIOENCODING": "ascii"}


def ldls(*words, **variables):
    command = [sys.executable, "-m", "ldls", *words]
    return subprocess.run(command, env={**os.environ, **variables}, capture_output=True, check=False)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_is_plain_text_in_a_locale_without_utf8(command):
    outcome = ldls(*command, "--help", **ASCII)
    assert (outcome.returncode, outcome.stderr) == (0, b"")
    assert b"Usage: ldls" in outcome.stdout
    assert outcome.stdout.isascii()


def test_names_that_the_locale_cannot_write_are_escaped(tmp_path):
    source = tmp_path / "Stra\u00dfe"
    source.mkdir()
    (source / "ldls.toml").write_text("[points]\n", encoding="utf-8")
    outcome = ldls("info", str(source), **ASCII)
    assert outcome.returncode == 1
    assert b"Traceback" not in outcome.stderr
    assert outcome.stderr.startswith(b"error: ")
    assert outcome.stderr.isascii()


@pytest.mark.parametrize("value", ["abc", "0", "-1", "1.5", "1025", "9" * 5000, ""])
def test_nonsense_in_ldls_num_threads_is_named(tmp_path, value):
    outcome = ldls("demo", "--out", str(tmp_path), LDLS_NUM_THREADS=value)
    assert outcome.returncode == 1
    assert outcome.stderr.startswith(b"error: LDLS_NUM_THREADS: got ")
    assert outcome.stderr.count(b"\n") == 1


def test_bytes_in_ldls_num_threads_that_are_no_text_are_named(tmp_path):
    outcome = ldls("demo", "--out", str(tmp_path), LDLS_NUM_THREADS="\udcff")
    assert outcome.returncode == 1
    assert outcome.stderr.startswith(b"error: LDLS_NUM_THREADS: got ")


def test_help_comes_whatever_ldls_num_threads_is():
    outcome = ldls("run", "--help", LDLS_NUM_THREADS="abc")
    assert (outcome.returncode, outcome.stderr) == (0, b"")


def test_a_cache_that_is_a_file_is_named(tmp_path):
    (tmp_path / "cache").write_text(json.dumps("a file"))
    outcome = ldls("reproduce", "--suite", "tuning", "--out", str(tmp_path), LDLS_CACHE=str(tmp_path / "cache"))
    assert outcome.returncode == 1
    assert outcome.stderr.startswith(b"error: LDLS_CACHE: ")


def test_without_a_home_the_cache_must_be_named(monkeypatch):
    monkeypatch.delenv("LDLS_CACHE", raising=False)

    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr("pathlib.Path.home", no_home)
    with pytest.raises(ParameterError, match="LDLS_CACHE: is not set"):
        suite_folder()
