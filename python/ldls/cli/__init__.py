"""The command `ldls`: one module a subcommand."""

from __future__ import annotations

import atexit
import gc
import io
import sys
from typing import Any

import typer
from typer.core import TyperGroup

from ldls.cli import annotate, demo, evaluate, explain, info, init, masks, reproduce, run, segment, simulate, view
from ldls.cli.command import Command


class Commands(TyperGroup):
    """The commands; what a terminal or a locale has no letter for comes out as its number, not as an error."""

    def main(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        """Run the command that is named."""
        # nearly all that a command imports and makes stays until it ends, and then the process ends too
        gc.set_threshold(100_000)
        atexit.register(gc.freeze)
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")
        return super().main(*args, **kwargs)


app = typer.Typer(
    cls=Commands,
    name="ldls",
    help="Instance labels for lidar points from 2D masks, by label diffusion.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.command(name="segment", cls=Command)(segment.segment)
# -3.2,1,0.5 is a place and no option
app.command(name="explain", cls=Command, context_settings={"ignore_unknown_options": True})(explain.explain)
app.command(name="init", cls=Command)(init.init)
app.command(name="info", cls=Command)(info.info)
app.command(name="run", cls=Command)(run.run)
app.add_typer(masks.app, name="masks")
app.command(name="view", cls=Command)(view.view)
app.command(name="demo", cls=Command)(demo.demo)
app.command(name="simulate", cls=Command)(simulate.simulate)
app.command(name="annotate", cls=Command)(annotate.annotate)
app.command(name="evaluate", cls=Command)(evaluate.evaluate)
app.command(name="reproduce", cls=Command)(reproduce.reproduce)


@app.callback(invoke_without_command=True)
def main(
    version: bool = typer.Option(False, "--version", help="Print the version and leave."),
) -> None:
    """Instance labels for lidar points from 2D masks, by label diffusion."""
    if version:
        from ldls import __version__

        typer.echo(f"ldls {__version__}")
        raise typer.Exit
