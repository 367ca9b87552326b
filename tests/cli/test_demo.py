"""`ldls demo`: without the extra `sim` on its sample, with it on any seed."""

import shlex
import sys

import pytest

from command import command


def test_the_sample_needs_no_extra(tmp_path, monkeypatch):
    for library in ("trimesh", "embreex", "scipy"):
        monkeypatch.setitem(sys.modules, library, None)
    outcome = command("demo", "--out", tmp_path)
    assert outcome.exit_code == 0, outcome.output


@pytest.mark.parametrize("library", ["trimesh", "embreex"])
def test_a_seed_names_the_extra_that_it_lacks(library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    outcome = command("demo", "--out", tmp_path / "out", "--seed", 3)
    assert outcome.exit_code == 1 and "pip install 'ldls[sim]'" in outcome.stderr
    assert not (tmp_path / "out").exists()


def test_a_seed_is_another_street(demo, tmp_path):
    pytest.importorskip("embreex")
    outcome = command("demo", "--out", tmp_path, "--seed", 8)
    assert outcome.exit_code == 0, outcome.output
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in demo[0].iterdir()}
    (mean,) = (line for line in outcome.output.splitlines() if "mean" in line)
    direct, method = (float(cell) for cell in mean.replace("│", " ").split()[1:3])
    assert method > direct + 10
    assert (tmp_path / "demo.png").read_bytes() != (demo[0] / "demo.png").read_bytes()


def test_the_command_for_its_files_can_be_pasted(tmp_path):
    outcome = command("demo", "--out", tmp_path / "two words")
    (line,) = (line for line in outcome.output.splitlines() if line.startswith("the same from files: ldls "))
    outcome = command(*shlex.split(line.partition("ldls ")[2]))
    assert outcome.exit_code == 0, outcome.output
    assert (tmp_path / "two words/from-files").is_dir()
