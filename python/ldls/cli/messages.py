"""Messages of commands: tables on standard output, errors on standard error with exit status 1."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.table import Table
from typer.models import OptionInfo

from ldls.cli.option_names import by_options
from ldls.errors import LdlsError

if TYPE_CHECKING:
    from ldls.segmentation import SegmentedObject

R = TypeVar("R")

STAGES = {
    "project": "project points",
    "pixel_labels": "pixel labels",
    "depth": "ground and depth groups",
    "neighbors": "nearest neighbours",
    "graph": "point graph",
    "diffusion": "diffusion",
    "components": "outlier removal",
}


QUIET = inspect.Parameter(
    "quiet",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, typer.Option("--quiet", "-q", help="Print errors and warnings only.")],
)
_quiet: ContextVar[bool] = ContextVar("quiet", default=False)
_options: ContextVar[Mapping[str, str]] = ContextVar("options", default=MappingProxyType({}))


def is_quiet() -> bool:
    """Return True where --quiet was given."""
    return _quiet.get()


def in_options(message: str) -> str:
    """`message` of the library with the options of the command in place of arguments."""
    return by_options(message, _options.get())


def speaks_plainly(command: Callable[..., R]) -> Callable[..., R]:
    """`command`, with its errors and warnings as single lines instead of tracebacks, and help for any width.

    A command that writes to OUT also gets the option --quiet.
    """
    own = inspect.signature(command, eval_str=True)
    parameters = [*own.parameters.values()]
    if "out" in own.parameters:
        parameters.append(QUIET)
    options = {each.name: option for each in parameters if (option := _option(each)) is not None}

    @functools.wraps(command)
    def wrapped(*args: Any, quiet: bool = False, **kwargs: Any) -> R:  # noqa: ANN401 - what Typer parsed
        _quiet.set(quiet)
        _options.set(options)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("default")
            try:
                result = command(*args, **kwargs)
            except (LdlsError, OSError, ImportError) as error:
                typer.secho(f"error: {_plain(error)}", err=True, fg="red")
                raise typer.Exit(1) from None
            finally:
                # each once, also where filters that change in between let it through again
                for message in dict.fromkeys(str(warning.message) for warning in caught):
                    typer.secho(f"warning: {in_options(message)}", err=True, fg="yellow")
        return result

    wrapped.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    wrapped.__annotations__ = {each.name: each.annotation for each in parameters}
    wrapped.__doc__ = flowing(inspect.getdoc(command) or "")
    return wrapped


def _option(parameter: inspect.Parameter) -> str | None:
    """The option of a parameter of a command, as --depth-gap; None for an argument."""
    for info in getattr(parameter.annotation, "__metadata__", ()):
        if isinstance(info, OptionInfo):
            # Typer takes the first for a default until it makes the command
            first = (info.default,) if isinstance(info.default, str) else ()
            given = [word for word in (*first, *(info.param_decls or ())) if word.startswith("--")]
            return given[0].partition("/")[0] if given else f"--{parameter.name.replace('_', '-')}"
    return None


def _plain(error: Exception) -> str:
    """What went wrong, in options; of the system's errors without their number."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return in_options(str(error)) if isinstance(error, LdlsError) else str(error)


def flowing(text: str) -> str:
    """`text` with each paragraph on one line, as terminals of any width can wrap it; "Examples:" keeps its own."""
    paragraphs = [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]
    return "\n\n".join(paragraph.replace("Examples: ", "Examples:\n", 1) for paragraph in paragraphs)


def object_table(objects: Sequence[SegmentedObject]) -> Table:
    """Name, points, distance and size of each object, the nearest first and those without points last."""
    from ldls.viewing.object_tables import HEADINGS, cells_of, nearest_first, objects_found

    table = Table(title=objects_found(objects))
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "object" else "right")
    for each in nearest_first(objects):
        table.add_row(*cells_of(each, each.label))
    return table


def timing_table(timings: Mapping[str, float]) -> Table:
    """Milliseconds of each stage and their sum."""
    table = Table(title="time", show_footer=True)
    total = sum(timings.values())
    table.add_column("stage", footer="all")
    table.add_column("ms", justify="right", footer=f"{total * 1e3:.1f}")
    table.add_column("share", justify="right", footer="100 %")
    for stage, seconds in timings.items():
        share = seconds / total if total > 0 else 0.0
        table.add_row(STAGES[stage], f"{seconds * 1e3:.1f}", f"{share:.0%}".replace("%", " %"))
    return table


def say_kept(count: int) -> None:
    """Say how many files or frames were there already and are as they were, if there are any."""
    if count:
        console().print(f"kept {count:,} that were there; delete them to make them anew")


class _Screen(Console):
    """A console that folds what is too wide for a table's column, where Rich cuts it."""

    def print(self, *objects: Any, **options: Any) -> None:  # noqa: ANN401 - what Rich prints, with its options
        for each in objects:
            for column in each.columns if isinstance(each, Table) else ():
                column.overflow = "fold"
        # a table of more columns than fit is as wide as its numbers need
        super().print(*objects, **{"crop": False, **options})


def console() -> Console:
    """Return the console for tables: as wide as the terminal, and wide enough where there is none; silent if quiet.

    It prints text as it is: names and paths may hold square brackets and colons, which mean something to Rich.
    """
    screen = _Screen(quiet=is_quiet(), markup=False, highlight=False, emoji=False)
    if not screen.is_terminal:
        screen.width = 100
    return screen
