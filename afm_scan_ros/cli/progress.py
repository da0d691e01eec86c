"""How far a scan is, from what its nodes say of themselves."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress, TaskID

from afm_scan_ros.nodes.peers import RUNNING
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
    """Listens to scan_info and node_state; shows the slowest node's progress and what any says."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        super().__init__("afm_scan")
        self._progress = progress
        self._task = task
        self._slowest: dict[str, int] = {}
        self._said = ""
        self.create_subscription(SCAN_INFO.kind, SCAN_INFO.name, self._meet, SCAN_INFO.reader)
        self.create_subscription(NODE_STATE.kind, NODE_STATE.name, self._hear, NODE_STATE.reader)

    def _meet(self, info: Message) -> None:
        self._progress.update(self._task, total=info.total_samples)

    def _hear(self, state: Message) -> None:
        if state.state == RUNNING and state.reason not in ("", self._said):
            self._said = state.reason
            said = f"{state.node}: {state.reason}"
            self._progress.console.print(said, highlight=False, soft_wrap=True)
        self._slowest[state.node] = state.next_sample
        self._progress.update(self._task, completed=min(self._slowest.values()))


@contextmanager
def watching(title: str) -> Iterator[Callable[[], None]]:
    """Show a progress bar; yield a function that listens for a moment."""
    init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        console = Console(stderr=True)
        seen = console.is_terminal
        with Progress(console=console, transient=True, disable=not seen) as progress:
            executor = SingleThreadedExecutor()
            executor.add_node(ScanWatch(progress, progress.add_task(title, total=None)))
            yield lambda: executor.spin_once(timeout_sec=MOMENT)
            executor.shutdown()
    finally:
        shutdown()
