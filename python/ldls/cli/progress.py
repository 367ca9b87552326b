"""How far a command is: a bar on a terminal, plain lines in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeVar

import typer

from ldls.cli.messages import is_quiet

T = TypeVar("T")
LINE_EVERY_S = 10.0
"""Seconds from one plain line to the next."""


def progress(items: Iterable[T], total: int, title: str) -> Iterator[T]:
    """The items, which are or become frames, with word of how many are done."""
    with frame_progress(title) as show:
        for done, item in enumerate(items, start=1):
            yield item
            show(done, 0, total)


@contextmanager
def frame_progress(title: str, *, resumes: bool = False) -> Iterator[Callable[[int, int, int], None]]:
    """Yield a function to call with the frames finished, those of them that failed, and in all.

    Where work `resumes`, the first call tells how many frames were finished earlier, of which no speed comes.

    Standard error shows a bar, speed, time left and failures if it is a terminal. Standard output has a line now and
    then, and one at the end, if it is none, so that a log tells how far the command is.
    """
    start = time.monotonic()
    said: float | None = None
    earlier = None if resumes else 0
    with _bar(title) as show:

        def update(finished: int, failed: int, total: int) -> None:
            nonlocal said, earlier
            now = time.monotonic()
            show(finished, failed, total)
            if earlier is None:
                earlier = finished
                return
            soon = said is not None and now - said < LINE_EVERY_S
            if sys.stdout.isatty() or is_quiet() or (soon and finished < total):
                return
            said = now
            rate = (finished - earlier) / max(now - start, 1e-9)
            failures = f", {failed:,} failed" if failed else ""
            # whoever reads the log may end before, as `head -1` does
            with suppress(BrokenPipeError):
                typer.echo(f"{title}: {finished:,} of {total:,} frames{failures}, {rate:.1f} a second")

        yield update


@contextmanager
def _bar(title: str) -> Iterator[Callable[[int, int, int], None]]:
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
    with Progress(*columns, console=screen, transient=True, disable=is_quiet() or not screen.is_terminal) as bar:
        task = bar.add_task(title, total=None, rate="", failed="")

        def show(finished: int, failed: int, total: int) -> None:
            speed = bar.tasks[0].speed
            bar.update(
                task,
                completed=finished,
                total=total,
                rate=f"{speed:.1f} frames/s" if speed else "",
                failed=f"{failed} failed" if failed else "",
            )

        yield show
