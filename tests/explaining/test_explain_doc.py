"""The commands and examples of docs/explain.md run, and print what is shown."""

import re
import shlex
from pathlib import Path

from command import command

DOC = (Path(__file__).parents[2] / "docs/explain.md").read_text()


def words(text):
    """Only the words: other machines may round numbers in another way."""
    return re.findall(r"[A-Za-z]+", text)


def test_commands_print_what_is_shown(own_demo, monkeypatch):
    monkeypatch.chdir(own_demo.parent)
    blocks = re.findall(r"```(sh|text)\n(.*?)```", DOC, re.DOTALL)
    commands = [line for kind, text in blocks if kind == "sh" for line in text.splitlines()]
    assert len(commands) == 10
    output = ""
    for kind, text in blocks:
        if kind == "text":
            shown = text.splitlines()
            printed = output.splitlines()[: len(shown)]
            assert printed[0] == shown[0]
            assert words("\n".join(printed)) == words(text)
            continue
        for line in text.splitlines():
            _, *arguments = shlex.split(line)
            outcome = command(*arguments)
            assert outcome.exit_code == 0, outcome.output
            output = outcome.output


def test_the_examples_run(own_demo, monkeypatch, capsys):
    monkeypatch.chdir(own_demo.parent)
    names = {}
    for example in re.findall(r"```python\n(.*?)```", DOC, re.DOTALL):
        exec(example, names)
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == names["found"].verdict
    assert [line.split()[0] for line in printed[-5:]] == ["2", "4", "6", "8", "10"]
    assert printed[-1].split()[1] == "12"
