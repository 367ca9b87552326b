"""Options that choose a source and its frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from ldls.errors import ParameterError

SourceArgument = Annotated[
    Path,
    typer.Argument(metavar="SOURCE", help="Data set, drive, bag or folder; `ldls info SOURCE` says what it holds."),
]
DatasetOption = Annotated[
    str | None,
    typer.Option(metavar="KIND", help="Kind of the source, where the path leaves it open.", show_default="guessed"),
]
SourceOption = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Of the kind: camera=3, scene=scene-0061; may be repeated."),
]
StoredMasksOption = Annotated[
    str | None,
    typer.Option(
        metavar="PATH",
        help="Stored masks: a folder with a file a frame; a path such as masks/{frame}.json, for several cameras "
        "masks/{camera}/{frame}.json; or one COCO .json of all images, by their file names.",
        show_default="those that the source names, as in ldls.toml",
    ),
]


def parse_options(words: Sequence[str]) -> dict[str, Any]:
    """Options by name; numbers, lists of numbers such as 2,3, and true and false are taken as such.

    Raises:
        ParameterError: One is not NAME=VALUE.
    """
    options: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not name or not equals:
            raise ParameterError(f"--option: got {word!r}, expected NAME=VALUE")
        options[name] = _value(value)
    return options


def _value(text: str) -> str | int | bool | tuple[int, ...]:
    if text in ("true", "false"):
        return text == "true"
    parts = text.split(",")
    if not all(part.isdecimal() for part in parts):
        return text
    # 08 names a sequence, 8 is a number
    padded = len(parts) == 1 and len(text) > 1 and text.startswith("0")
    return text if padded else int(text) if len(parts) == 1 else tuple(map(int, parts))
