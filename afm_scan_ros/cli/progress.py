"""Shows how what takes long goes on: a line or a bar in a terminal, lines in a log."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from attrs import define, field, frozen
from rich.console import Console
from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TaskID, TextColumn
from rich.text import Text

from afm_scan_ros.core.types import ProgressCallback, Step
from afm_scan_ros.progress import Stopwatch
from afm_scan_ros.report.terminal import say, showing_log, visible

EVERY = 20.0
"""Least time between two lines of a log, s."""


@contextmanager
def working(title: str, *, at_once: bool = True) -> Iterator[ProgressCallback]:
    """Show a title with the time elapsed; yield a function that shows the current step.

    Log messages of the package are shown too. Outside a terminal the first line comes ``at_once``,
    or after ``EVERY`` seconds, where the input may be refused soon.
    """
    console = Console(stderr=True)
    shown = _one_line(title, console) if console.is_terminal else _repeated(title, at_once=at_once)
    with showing_log(), shown as report:
        yield report


@contextmanager
def _one_line(title: str, console: Console) -> Iterator[ProgressCallback]:
    watch = Stopwatch()
    columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimesColumn(watch)
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(visible(title))

        def report(doing: str) -> None:
            watch.hear(doing)
            progress.update(task, description=visible(f"{title}: {doing}"))

        yield report


class TimesColumn(ProgressColumn):
    """The time elapsed and what is left, at each moment."""

    def __init__(self, watch: Stopwatch) -> None:
        super().__init__()
        self._watch = watch

    def render(self, task: Task) -> Text:  # noqa: ARG002 - as rich calls it
        """Return what stands at the end of the line."""
        return Text(f"({self._watch})", style="progress.elapsed")


@define
class Lines:
    """Writes what is being done to stderr, at most every ``EVERY`` seconds."""

    title: str
    _due: float = 0.0
    _watch: Stopwatch = field(factory=Stopwatch)
    _doing: str = field(default="under way", init=False)

    def __call__(self, doing: str) -> None:
        """Write what is being done from now on, unless the last line was just written."""
        self._doing = doing
        self._watch.hear(doing)
        self.again()

    def again(self) -> None:
        """Write what is still being done, unless the last line was just written."""
        if (now := self._watch.elapsed) >= self._due:
            self._due = now + EVERY
            say(f"{self.title}: {self._doing} ({self._watch})", err=True)


@contextmanager
def _repeated(title: str, *, at_once: bool) -> Iterator[ProgressCallback]:
    """Write lines, also while one step lasts long."""
    lines, over = Lines(title, 0.0 if at_once else EVERY), Event()

    def repeat() -> None:
        while not over.wait(EVERY):
            lines.again()

    Thread(target=repeat, daemon=True).start()
    try:
        yield lines
    finally:
        over.set()


@frozen(eq=False)
class ScanProgress:
    """The progress of one scan."""

    _bar: Progress
    _task: TaskID
    _report: ProgressCallback

    def doing(self, what: str) -> None:
        """Show what is done before the scan begins."""
        self._report(what)

    def moved(self, sample: int, total: int) -> None:
        """Show how many samples of all are achieved."""
        self._bar.update(self._task, completed=sample, total=total)
        self._report(Step(f"{sample / total:.0%}, sample {sample} of {total}", sample, total))

    def say(self, news: str) -> None:
        """Show what the user should know, once and to stay."""
        self._bar.console.print(visible(news), highlight=False, soft_wrap=True, markup=False)


@contextmanager
def showing(title: str) -> Iterator[ScanProgress]:
    """Show a scan while it runs."""
    console = Console(stderr=True)
    seen = console.is_terminal
    report = (lambda _: None) if seen else Lines(title, EVERY)  # where no bar is seen
    with Progress(console=console, transient=True, disable=not seen) as bar:
        yield ScanProgress(bar, bar.add_task(title, total=None), report)
