"""Commands where the environment has nonsense in it, or the locale no letters but ASCII."""

import json

import pytest
from typer.main import get_command

from command import process
from ldls.cli import app
from ldls.errors import ParameterError
from ldls.simulation import suite_folder

COMMANDS = [(), *((name,) for name in get_command(app).commands)]
ASCII = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C", "PYTHONIOENCODING": "ascii"}


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_is_plain_text_in_a_locale_without_utf8(command):
    outcome = process(*command, "--help", **ASCII)
    assert (outcome.returncode, outcome.stderr) == (0, "")
    assert "Usage: ldls" in outcome.stdout
    assert outcome.stdout.isascii()


def test_names_that_the_locale_cannot_write_are_escaped(tmp_path):
    source = tmp_path / "Stra\u00dfe"
    source.mkdir()
    (source / "ldls.toml").write_text("[points]\n", encoding="utf-8")
    outcome = process("info", source, **ASCII)
    assert outcome.returncode == 1
    assert "Traceback" not in outcome.stderr
    assert outcome.stderr.startswith("error: ")
    assert outcome.stderr.isascii()


@pytest.mark.parametrize("value", ["abc", "0", "-1", "1.5", "1025", "9" * 5000, ""])
def test_nonsense_in_ldls_num_threads_is_named(tmp_path, value):
    outcome = process("demo", "--out", tmp_path, LDLS_NUM_THREADS=value)
    assert outcome.returncode == 1
    assert outcome.stderr.startswith("error: LDLS_NUM_THREADS: got ")
    assert outcome.stderr.count("\n") == 1


def test_bytes_in_ldls_num_threads_that_are_no_text_are_named(tmp_path):
    outcome = process("demo", "--out", tmp_path, LDLS_NUM_THREADS="\udcff")
    assert outcome.returncode == 1
    assert outcome.stderr.startswith("error: LDLS_NUM_THREADS: got ")


def test_help_comes_whatever_ldls_num_threads_is():
    outcome = process("run", "--help", LDLS_NUM_THREADS="abc")
    assert (outcome.returncode, outcome.stderr) == (0, "")


def test_a_cache_that_is_a_file_is_named(tmp_path):
    (tmp_path / "cache").write_text(json.dumps("a file"))
    outcome = process("reproduce", "--suite", "tuning", "--out", tmp_path, LDLS_CACHE=str(tmp_path / "cache"))
    assert outcome.returncode == 1
    assert outcome.stderr.startswith("error: LDLS_CACHE: ")


def test_without_a_home_the_cache_must_be_named(monkeypatch):
    monkeypatch.delenv("LDLS_CACHE", raising=False)

    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr("pathlib.Path.home", no_home)
    with pytest.raises(ParameterError, match="LDLS_CACHE: is not set"):
        suite_folder()
