"""The class of all commands."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand

EXPECTED, FAULT = "Input should be ", "Value error, "
"""How the library behind newer versions of Typer begins what it expects, and what Typer itself says."""


class Command(TyperCommand):
    """A command whose usage line names its arguments without braces, and whose errors say what was given."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401
        """Return the words that are no options, as Typer does."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            error.message = error.message.removeprefix(FAULT)
            if error.message.startswith(EXPECTED) and isinstance(error.__cause__, ValueError):
                expected = error.message.removeprefix(EXPECTED).partition(", unable")[0]
                given = error.__cause__.errors()[0]["input"]  # type: ignore[attr-defined]
                error.message = f"got {given!r}, expected {expected}"
            raise

    def collect_usage_pieces(self, ctx: Any) -> list[str]:  # noqa: ANN401 - the context of Typer's own copy of click
        """Return options and arguments as the usage line has them."""
        return [piece.strip("{}") for piece in super().collect_usage_pieces(ctx)]
