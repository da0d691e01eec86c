"""What a long computation is at, shown on a terminal while it lasts."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn


@contextmanager
def working(title: str) -> Iterator[Callable[[str], None]]:
    """Show a title with the time elapsed; yield a function that says what is being done."""
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    console = Console(stderr=True)
    seen = console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=not seen) as progress:
        task = progress.add_task(title)
        yield lambda doing: progress.update(task, description=f"{title}: {doing}")
