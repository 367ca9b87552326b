"""Options that choose a source and its frames."""

from __future__ import annotations

import json
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
    typer.Option(
        "--option",
        metavar="NAME=VALUE",
        help="Of the kind: camera=3, scene=scene-0061, image_topics=/left,/right; may be repeated. Values are JSON, "
        'lists with commas, or text; "5" in quotes is text.',
    ),
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
    """Options by name: values that are JSON are read as that, those with commas, as 2,3, as lists, others as text.

    Raises:
        ParameterError: One is not NAME=VALUE, or names what is no option of a kind.
    """
    options: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not name or not equals:
            raise ParameterError(f"--option: got {word!r}, expected NAME=VALUE")
        if name in ("path", "kind"):
            raise ParameterError(f"--option: got {word!r}, expected an option of the kind, which --dataset names")
        options[name] = _value(value)
    return options


def _value(text: str) -> Any:  # noqa: ANN401
    try:
        return json.loads(text)
    except ValueError:
        # 08, which names a sequence, is no number of JSON
        return tuple(map(_value, text.split(","))) if "," in text else text
