"""The pages of the documentation: code, commands, pictures and how these are made."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from os.path import normpath
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs/images"
FENCED = re.compile(r"^```(?P<language>\w*)\n(?P<code>.*?)^```$", re.DOTALL | re.MULTILINE)
INLINE = re.compile(r"(?<!`)`(?P<code>[^`]+)`(?!`)")
SHOWN = re.compile(r"!\[[^\]]*\]\((?P<path>[^)\s]+)\)")
MADE = re.compile(r"^<!-- (?P<picture>\S+) is (?P<file>\S+) -->$", re.MULTILINE)
RECIPE = re.compile(rf"(?:{MADE.pattern}\n)+\n?{FENCED.pattern}", re.DOTALL | re.MULTILINE)
SHELL_WORDS = re.compile(r"&&|\|\||[|;]")


@dataclass(frozen=True)
class Recipe:
    """Commands that make pictures.

    Attributes:
        commands: A block of shell, to be run in an empty folder or one where the page's earlier recipes ran.
        files: What becomes of it: pictures by their paths in the repository, each with the file it is a copy of.
    """

    commands: str
    files: dict[str, str]


def pages() -> list[Path]:
    """README.md, and every page below docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(text: str, language: str) -> list[str]:
    """The fenced blocks of a language, "" for those of none, in their order."""
    return [found["code"] for found in FENCED.finditer(text) if found["language"] == language]


def shown(page: Path) -> list[str]:
    """The pictures that a page shows, as paths in the repository."""
    return [_in_repository(page, found["path"]) for found in SHOWN.finditer(page.read_text())]


def recipes(page: Path) -> list[Recipe]:
    """Return how a page's pictures are made: `<!-- PICTURE is FILE -->` before a block of shell that writes FILE."""
    return [_recipe(page, found[0]) for found in RECIPE.finditer(page.read_text())]


def commands(block: str) -> list[list[str]]:
    """The words of each `ldls ...` in a block of shell."""
    return [words for words in shell_commands(block) if words[0] == "ldls"]


def shell_commands(block: str) -> list[list[str]]:
    """The words of each command in a block of shell."""
    lines = block.replace("\\\n", " ").splitlines()
    parts = [shlex.split(part, comments=True) for line in lines for part in SHELL_WORDS.split(line)]
    return [words for words in parts if words]


def inline_commands(text: str) -> list[list[str]]:
    """The words of each `ldls ...` that stands in a sentence."""
    prose = FENCED.sub("", text)
    return [shlex.split(code["code"]) for code in INLINE.finditer(prose) if code["code"].startswith("ldls ")]


def _recipe(page: Path, text: str) -> Recipe:
    files = {_in_repository(page, made["picture"]): made["file"] for made in MADE.finditer(text)}
    (block,) = blocks(text, "sh")
    return Recipe(block, files)


def _in_repository(page: Path, path: str) -> str:
    return normpath(page.parent.relative_to(ROOT) / path)
