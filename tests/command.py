"""The command `ldls` in this process, and in one of its own."""

import os
import subprocess
import sys

from typer.testing import CliRunner

from ldls.cli import app


def command(*words, **environment):
    """The outcome of `ldls` with these words."""
    return CliRunner().invoke(app, [str(word) for word in words], env=environment)


def process(*words, **environment):
    """The same in a process of its own."""
    return python("-m", "ldls", *words, **environment)


def python(*words, **environment):
    """An interpreter that was given these words, after its end."""
    program, environment = [sys.executable, *map(str, words)], os.environ | environment
    return subprocess.run(program, env=environment, capture_output=True, text=True, timeout=600, check=False)
