"""The help of every command, from the program itself, in the place of a marker."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from typing import TYPE_CHECKING, Any

import typer

from ldls.cli import app

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

MARKER = "<!-- commands -->"
EXAMPLE = re.compile(r"(Examples?:\s+)?ldls ")
ANOTHER = re.compile(r",?\s+and\b[\w\s,]*(?=\bldls )")
WIDTH = 88


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """The page with a section for each command where its marker stands."""
    if MARKER not in markdown:
        return markdown
    return markdown.replace(MARKER, "\n\n".join(section(name, command) for name, command in commands()))


def commands() -> Iterator[tuple[str, Any]]:
    """Name, as "ldls masks show", and click command of each command, in the order of `ldls --help`."""
    yield from _below("ldls", typer.main.get_command(app))


def _below(name: str, command: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    subcommands = getattr(command, "commands", None)
    if subcommands is None:
        yield name, command
        return
    for word, subcommand in subcommands.items():
        yield from _below(f"{name} {word}", subcommand)


def section(name: str, command: Any) -> str:  # noqa: ANN401
    """Heading, usage, help and options of a command in Markdown."""
    context = command.context_class(command, info_name=name)
    usage = command.get_usage(context).removeprefix("Usage: ")
    paragraphs = [paragraph(text) for text in command.help.split("\n\n")]
    records = [record for parameter in command.params if (record := parameter.get_help_record(context))]
    return "\n\n".join([f"## {name}", f"```text\n{usage}\n```", *paragraphs, table(records)])


def paragraph(text: str) -> str:
    """A paragraph of help: examples as code, everything else as text."""
    if EXAMPLE.match(text):
        return "```sh\n" + "\n".join(map(wrapped, examples(text))) + "\n```"
    return f"<p>{escape(text)}</p>"


def examples(text: str) -> list[str]:
    """The commands of a paragraph of examples, a line each."""
    return [" ".join(example.split()) for example in ANOTHER.split(re.sub(r"^Examples?:\s+", "", text))]


def wrapped(command: str) -> str:
    """A command over several lines, where it is too long for one; options stay with their values."""
    first, *options = re.split(r" (?=--)", command)
    lines = [first]
    for option in options:
        if len(lines[-1]) + len(option) > WIDTH:
            lines.append("   ")
        lines[-1] += f" {option}"
    return " \\\n".join(lines)


def table(records: list[tuple[str, str]]) -> str:
    """Options and what they do, as HTML: their texts may hold what Markdown takes for its own."""
    rows = "\n".join(
        f"<tr><td><code>{breakable(option)}</code></td><td>{escape(what)}</td></tr>" for option, what in records
    )
    return f"<table>\n<thead><tr><th>option</th><th>what it does</th></tr></thead>\n<tbody>\n{rows}\n</tbody>\n</table>"


def breakable(option: str) -> str:
    """An option as HTML that may be broken where values are listed."""
    return escape(option).replace("|", "|<wbr>")
