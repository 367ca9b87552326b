"""The command `ldls`: one module a subcommand."""

from __future__ import annotations

import io
import sys
from typing import Any

import typer
from typer.core import TyperGroup

from ldls.cli import annotate, demo, evaluate, explain, info, masks, reproduce, run, segment, simulate, view


class Commands(TyperGroup):
    """The commands; what a terminal or a locale has no letter for comes out as its number, not as an error."""

    def main(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        """Run the command that is named."""
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")
        return super().main(*args, **kwargs)


app = typer.Typer(
    cls=Commands,
    name="ldls",
    help="Instance labels for lidar points from 2D masks, by label diffusion.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.command(name="segment")(segment.segment)
# -3.2,1,0.5 is a place and no option
app.command(name="explain", context_settings={"ignore_unknown_options": True})(explain.explain)
app.command(name="info")(info.info)
app.command(name="run")(run.run)
app.add_typer(masks.app, name="masks")
app.command(name="view")(view.view)
app.command(name="demo")(demo.demo)
app.command(name="simulate")(simulate.simulate)
app.command(name="annotate")(annotate.annotate)
app.command(name="evaluate")(evaluate.evaluate)
app.command(name="reproduce")(reproduce.reproduce)


@app.callback(invoke_without_command=True)
def main(
    version: bool = typer.Option(False, "--version", help="Print the version and leave."),
) -> None:
    """Instance labels for lidar points from 2D masks, by label diffusion."""
    if version:
        from ldls import __version__

        typer.echo(f"ldls {__version__}")
        raise typer.Exit
