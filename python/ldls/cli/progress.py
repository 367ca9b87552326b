"""A bar that shows how far a command is, on a terminal only."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
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


@contextmanager
def frame_progress(title: str) -> Iterator[Callable[[int, int, int], None]]:
    """Yield a function to call with the frames finished, failed and in all; shows a bar, speed, time left, failures."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    screen = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[failed]}"),
    )
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(title, total=None, rate="", failed="")

        def update(finished: int, failed: int, total: int) -> None:
            speed = bar.tasks[0].speed
            bar.update(
                task,
                completed=finished,
                total=total,
                rate=f"{speed:.1f} frames/s" if speed else "",
                failed=f"{failed} failed" if failed else "",
            )

        yield update
