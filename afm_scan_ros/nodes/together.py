"""Runs nodes together in one process and one thread, where no other process can be reached."""

import time
from collections.abc import Callable, Sequence

from attrs import frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.nodes.run import hear, node_class, warn_of_undeclared
from afm_scan_ros.nodes.scan_node import ScanNode
from afm_scan_ros.ros import SingleThreadedExecutor
from afm_scan_ros.ros.cyclone.context import use_arguments

GRACE = 5.0
"""Seconds that the other nodes have to end by themselves once one has ended badly."""
MOMENT = 1e-3
"""Seconds to wait where no node has anything to do."""


@frozen
class Ended:
    """How a node ended: 0, 2 bad input, 3 what was asked does not hold, negative for a signal.

    ``traceback`` is its output where that holds the traceback of an unforeseen error.
    """

    name: str
    status: int
    said: str
    traceback: str = ""


@frozen(eq=False)
class _Living:
    """A node with what calls it back."""

    node: ScanNode
    executor: SingleThreadedExecutor

    def live(self) -> bool:
        """Call back and tick; return whether there is more to do at once."""
        try:
            hear(self.node, self.executor, 0.0)
            return self.node.tick() or self.executor.has_work()
        except (InputError, ScanError) as error:
            self.node.fail(error)
            return True


def run_together(
    commands: Sequence[tuple[str, Sequence[str]]], idle: Callable[[], None]
) -> list[Ended]:
    """Run nodes, each a name and its command line, until all have ended; return their status.

    ``idle`` is called now and then. Raises KeyboardInterrupt once all have ended because of it.
    """
    living: list[_Living] = []
    try:
        for name, words in commands:
            try:
                living.append(_made(name, words))
            except InputError as error:
                return [Ended(name, 2, f"{name}: {error}")]
        names = [each.node.get_name() for each in living]
        for each in living:
            each.node.hear_others()
        try:
            _live(living, idle)
        except KeyboardInterrupt:
            _interrupt(living)
            _live(living, idle)
            raise
    finally:
        for each in living:
            each.executor.shutdown()
            each.node.destroy_node()
    return [_ended(name, each.node) for name, each in zip(names, living, strict=True)]


def _made(name: str, words: Sequence[str]) -> _Living:
    kind = node_class(name)
    use_arguments(words)
    node, executor = kind(), SingleThreadedExecutor()
    warn_of_undeclared(node)
    executor.add_node(node)
    return _Living(node, executor)


def _live(living: Sequence[_Living], idle: Callable[[], None]) -> None:
    """Return when all nodes are finished; those that do not end by themselves are interrupted."""
    deadline = None
    while left := [each for each in living if not each.node.finished]:
        busy = [each.live() for each in left]
        if not any(busy):
            time.sleep(MOMENT)
        idle()
        now = time.monotonic()
        if deadline is None and any(e.node.finished and e.node.status for e in living):
            deadline = now + GRACE
        if deadline is not None and now > deadline:
            _interrupt(left)


def _interrupt(living: Sequence[_Living]) -> None:
    for each in living:
        if not each.node.leaving:
            each.node.interrupt("SIGINT")


def _ended(name: str, node: ScanNode) -> Ended:
    return Ended(name, node.status, f"{name}: {' '.join(node.reason.split())}")
