"""The class of all commands."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand


class Command(TyperCommand):
    """A command whose usage line names its arguments without braces."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:  # noqa: ANN401 - the context of Typer's own copy of click
        """Return options and arguments as the usage line has them."""
        return [piece.strip("{}") for piece in super().collect_usage_pieces(ctx)]
