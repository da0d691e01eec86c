"""Shows how a scan goes on: a bar in a terminal, lines in a log."""

from collections.abc import Iterator
from contextlib import contextmanager

from attrs import frozen
from rich.console import Console
from rich.progress import Progress, TaskID

from afm_scan_ros.cli.options import in_lines
from afm_scan_ros.core.types import ProgressCallback, Step
from afm_scan_ros.report.terminal import visible


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


def _ignore(doing: str) -> None:
    """Write no line, because a terminal shows the bar."""


@contextmanager
def showing(title: str) -> Iterator[ScanProgress]:
    """Show a scan while it runs."""
    console = Console(stderr=True)
    seen = console.is_terminal
    report = _ignore if seen else in_lines(title, at_once=False)
    with Progress(console=console, transient=True, disable=not seen) as bar:
        yield ScanProgress(bar, bar.add_task(title, total=None), report)
