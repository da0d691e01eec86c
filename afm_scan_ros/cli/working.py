"""What a long computation is at: one line that changes on a terminal, a few lines elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

import click
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

Told = Callable[[str], None]

EVERY = 20.0
"""Seconds between two lines at least: a log shows that it goes on, and is not flooded."""


@contextmanager
def working(title: str, *, at_once: bool = True) -> Iterator[Told]:
    """Show a title with the time elapsed; yield a function that says what is being done.

    Outside a terminal the first line comes ``at_once``, or after ``EVERY`` seconds: where much may
    be refused soon, that is one line then.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        yield in_lines(title, at_once=at_once)
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title)
        yield lambda doing: progress.update(task, description=f"{title}: {doing}")


def in_lines(title: str, clock: Callable[[], float] = monotonic, *, at_once: bool = True) -> Told:
    """Return a function that writes what is being done to stderr: at first, and then rarely.

    Nothing is written before: what is refused at once is told in one line.
    """
    began = clock()
    due = began if at_once else began + EVERY

    def told(doing: str) -> None:
        nonlocal due
        now = clock()
        if now >= due:
            due = now + EVERY
            click.echo(f"{title}: {doing} ({now - began:.0f} s)", err=True)

    return told
