"""Progress of a scan, from the states that its nodes publish."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress, TaskID

from afm_scan_ros.cli.working import ProgressCallback, in_lines
from afm_scan_ros.nodes.node_state import RUNNING
from afm_scan_ros.nodes.topics import NODE_STATE, SCAN_INFO
from afm_scan_ros.ros import (
    Message,
    Node,
    SignalHandlerOptions,
    SingleThreadedExecutor,
    init,
    shutdown,
)

MOMENT = 0.1


class ScanWatch(Node):
    """Listens to scan_info and node_state; shows the slowest node's progress and all reasons.

    ``report`` writes lines to a log; a terminal shows the bar instead.
    """

    def __init__(self, progress: Progress, task: TaskID, report: ProgressCallback) -> None:
        super().__init__("afm_scan")
        self._progress = progress
        self._task = task
        self._report = report
        self._total = 0
        self._slowest: dict[str, int] = {}
        self._last_reason = ""
        self.create_subscription(SCAN_INFO.kind, SCAN_INFO.name, self._meet, SCAN_INFO.reader)
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)

    def _meet(self, info: Message) -> None:
        self._total = info.total_samples
        self._progress.update(self._task, total=self._total)

    def _hear(self, state: Message) -> None:
        if state.state == RUNNING and state.reason not in ("", self._last_reason):
            self._last_reason = state.reason
            message = f"{state.node}: {state.reason}"
            self._progress.console.print(message, highlight=False, soft_wrap=True)
        self._slowest[state.node] = state.next_sample
        done = min(self._slowest.values())
        self._progress.update(self._task, completed=done)
        if not done:
            self._report(f"{state.node}: {state.reason or state.state}")
        elif self._total:
            self._report(f"{done / self._total:.0%}, sample {done} of {self._total}")


def _ignore(doing: str) -> None:
    """Write no line, because a terminal shows the bar."""


@contextmanager
def watching(title: str) -> Iterator[Callable[[], None]]:
    """Show a progress bar, or lines in a log; yield a function that listens for a moment."""
    init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        console = Console(stderr=True)
        seen = console.is_terminal
        report = _ignore if seen else in_lines(title, at_once=False)
        with Progress(console=console, transient=True, disable=not seen) as progress:
            executor = SingleThreadedExecutor()
            executor.add_node(ScanWatch(progress, progress.add_task(title, total=None), report))
            yield lambda: executor.spin_once(timeout_sec=MOMENT)
            executor.shutdown()
    finally:
        shutdown()
