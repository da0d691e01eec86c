"""Progress of a long computation: a changing line on a terminal, a few lines in a log."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

import click
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

ProgressCallback = Callable[[str], None]

EVERY = 20.0
"""Least time between two lines of a log, s."""


@contextmanager
def working(title: str, *, at_once: bool = True) -> Iterator[ProgressCallback]:
    """Show a title with the time elapsed; yield a function that shows the current step.

    Log messages of the package are shown too. Outside a terminal the first line comes ``at_once``,
    or after ``EVERY`` seconds, where the input may be refused soon.
    """
    log, handler = logging.getLogger("afm_scan_ros"), _ToStderr()
    log.addHandler(handler)
    try:
        with _progress_line(title, at_once=at_once) as report:
            yield report
    finally:
        log.removeHandler(handler)


@contextmanager
def _progress_line(title: str, *, at_once: bool) -> Iterator[ProgressCallback]:
    console = Console(stderr=True)
    if not console.is_terminal:
        yield in_lines(title, at_once=at_once)
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title)
        yield lambda doing: progress.update(task, description=f"{title}: {doing}")


class _ToStderr(logging.Handler):
    """Shows what is logged as the commands show their own messages."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line."""
        click.echo(f"{record.levelname.lower()}: {record.getMessage()}", err=True)


def in_lines(
    title: str, clock: Callable[[], float] = monotonic, *, at_once: bool = True
) -> ProgressCallback:
    """Return a function that writes the current step to stderr, at most every ``EVERY`` seconds."""
    began = clock()
    due = began if at_once else began + EVERY

    def report(doing: str) -> None:
        nonlocal due
        now = clock()
        if now >= due:
            due = now + EVERY
            click.echo(f"{title}: {doing} ({now - began:.0f} s)", err=True)

    return report
