"""A bar that shows how far a command is, on a terminal only."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def progress(items: Iterable[T], total: int, title: str) -> Iterator[T]:
    """The items, with a bar on standard error meanwhile if that is a terminal."""
    from rich.console import Console
    from rich.progress import track

    screen = Console(stderr=True)
    yield from track(
        items, total=total, description=title, console=screen, transient=True, disable=not screen.is_terminal
    )
