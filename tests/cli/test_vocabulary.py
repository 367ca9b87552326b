"""One vocabulary of options over all commands: one word for one thing, and one thing for one word."""

from collections import defaultdict

import pytest
import typer

from command import command
from ldls.cli import app

OTHER_WORDS = {
    "--format": "--formats",
    "--threads": "--cores",
    "--workers": "--cores",
    "--processes": "--cores",
    "--jobs": "--cores",
    "--classes": "--categories",
    "--output": "--out",
    "--images": "--image",
    "--calibration": "--calib",
    "--n-frames": "--count",
}
"""Words that other programs use, and ours for the same."""
OF_A_FRAME_OR_OF_MANY = {
    "--image": {"FILE", "[CAMERA=]FILE", "FOLDER"},
    "--points": {"FILE", "FOLDER"},
    "--calib": {"PATH", "FOLDER"},
}
"""Values that differ: the file of a frame, a file for each camera, or the folder of many frames."""


def commands(command=None, name="ldls"):
    command = command or typer.main.get_command(app)
    if hasattr(command, "commands"):
        for word, each in command.commands.items():
            yield from commands(each, f"{name} {word}")
    else:
        yield pytest.param(name, command, id=name)


COMMANDS = list(commands())


@pytest.mark.parametrize(("name", "described"), COMMANDS)
def test_no_command_has_a_word_of_its_own_for_what_has_one(name, described):
    words = {word for param in described.params for word in param.opts}
    assert words.isdisjoint(OTHER_WORDS), [f"{word} is {ours}" for word, ours in OTHER_WORDS.items() if word in words]


def test_an_option_takes_the_same_value_in_every_command():
    values = defaultdict(set)
    for case in COMMANDS:
        _, described = case.values
        for param in described.params:
            values[param.opts[-1] if param.param_type_name == "option" else param.metavar].add(param.metavar)
    differing = {option: taken for option, taken in values.items() if len(taken) > 1}
    assert differing == OF_A_FRAME_OR_OF_MANY


@pytest.mark.parametrize(("name", "described"), COMMANDS)
def test_help_shows_values_in_capitals_by_h_as_well(name, described):
    words = name.split()[1:]
    text = command(*words, "-h", COLUMNS="160").output
    assert text == command(*words, "--help", COLUMNS="160").output
    assert "Example" in text, "how it is called is taught by an example"
    usage = text.split("Usage: ", 1)[1].splitlines()[0]
    assert usage.startswith(name)
    assert "{" not in usage
    unnamed = [param.opts[-1] for param in described.params if not (getattr(param, "is_flag", False) or param.metavar)]
    assert unnamed == []


@pytest.mark.parametrize(("name", "described"), COMMANDS)
def test_help_in_a_narrow_terminal_has_all_words_whole(name, described):
    text = command(*name.split()[1:], "--help", COLUMNS="80").output
    assert "…" not in text
    choices = [word for param in described.params for word in (param.metavar or "").replace("|", " ").split()]
    assert [word for word in choices if word not in text] == []


def test_lists_are_separated_by_commas(tmp_path):
    outcome = command("run", tmp_path, "--out", "o", "--formats", "npz", "--formats", "png")
    assert outcome.exit_code != 0
