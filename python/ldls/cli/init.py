"""`ldls init`: the description of a folder of one's own files."""

from __future__ import annotations

import warnings
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from ldls.cli.messages import console, speaks_plainly
from ldls.errors import InputError, LdlsWarning, UnsafePathError


@speaks_plainly
def init(
    folder: Annotated[
        Path,
        typer.Argument(metavar="FOLDER", help="Folder with sweeps, images, masks.", exists=True, file_okay=False),
    ],
) -> None:
    """Look at the files of a folder and write ldls.toml, which tells the other commands what they are.

    Finds sweeps and images by their names, calibrations by their content, and the transform of several that shows the
    points in the image, upright. What it could not know stands there as a question behind # ?. Says what is missing,
    and what to do next; exit status 1 as long as the folder lacks something. A data set or bag that is read as it is
    needs no such file.

    Example: ldls init mine, and then ldls info mine --picture check.png
    """
    from ldls.datasets import open_source
    from ldls.datasets.folder_description import FILE
    from ldls.datasets.proposal import propose
    from ldls.datasets.registry import SOURCES
    from ldls.io.files import whole_file

    screen = console()

    def say(text: str) -> None:
        screen.print(text, soft_wrap=True)

    path = folder / FILE
    if path.exists():
        raise InputError(f"{path}: is there already; change it, or delete it to have it made anew")
    kinds = [kind for kind, source in SOURCES.items() if source.recognises(folder)]
    if kinds:
        say(f"{folder} is read as it is ({' or '.join(kinds)}), without {FILE}; next: ldls info {quote(str(folder))}")
        return
    inside = [child for child in sorted(folder.iterdir()) if any(each.recognises(child) for each in SOURCES.values())]
    if inside:
        names, first = ", ".join(child.name for child in inside), quote(str(inside[0]))
        say(f"{names}: read without {FILE}; next: ldls info {first}")
        return
    next_step = f"ldls info {quote(str(folder))} --picture check.png"
    made = propose(folder)
    with whole_file(path) as file:
        file.write(made.text.encode())
    for line in made.found:
        say(f"found    {line}")
    for line in made.missing:
        say(f"missing  {line}")
    questions = sum(line.startswith("# ?") for line in made.lines)
    say(f"wrote {path}" + (f"; lines with # ? ask what to look at: {questions}" if questions else ""))
    if made.missing:
        say(f"next: add what is missing to {path}, then: {next_step}")
        raise typer.Exit(1)
    # what is written must open
    allowed = ""
    try:
        open_source(folder)
    except UnsafePathError:
        allowed = " --option allow_outside=true"
        message = f"{folder}: links lead out of it; copy their files there, or give each command{allowed}"
        warnings.warn(message, LdlsWarning, stacklevel=2)
        open_source(folder, allow_outside=True)
    say(f"next: {next_step}{allowed}; do the colours change where objects end?")
