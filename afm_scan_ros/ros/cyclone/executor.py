"""Waits for messages and requests, and calls back, one at a time in one thread."""

import time
from collections.abc import Callable, Iterator
from math import inf
from typing import TYPE_CHECKING, Any

from attrs import Factory, define, field

from afm_scan_ros.ros.cyclone.base import ExternalShutdownException
from afm_scan_ros.ros.cyclone.context import current_context, ok
from afm_scan_ros.ros.cyclone.endpoints import Readable
from afm_scan_ros.ros.cyclone.node import Node

if TYPE_CHECKING:  # or those of one process
    from cyclonedds.core import GuardCondition

    from afm_scan_ros.ros.cyclone.domain import Context
    from afm_scan_ros.ros.cyclone.wire import EntityWaits

NANOSECONDS = 1e9
SLICE = 0.1  # s; a signal's handler runs between two waits, never within one


@define(eq=False)
class SingleThreadedExecutor:
    """Runs the callbacks of its nodes; made after ``init``."""

    _context: "Context" = Factory(current_context)
    _nodes: list[Node] = Factory(list)
    _attached: dict[int, tuple[Readable, Any]] = Factory(dict)
    _waits: "EntityWaits" = field(init=False)
    _there: list[int] | None = None
    _waker: "GuardCondition" = field(init=False)
    _work: Iterator[Callable[[], object] | None] = field(init=False)

    def __attrs_post_init__(self) -> None:
        self._waits, self._waker = self._context.waits(), self._context.waker()
        self._waits.add(self._waker, id(self._waker))
        self._context.wakers.append(self._waker)
        self._work = self._rounds()

    def add_node(self, node: Node) -> bool:
        """Call back for this node too; tell whether it is new here."""
        if node in self._nodes:
            return False
        self._nodes.append(node)
        self.wake()
        return True

    def remove_node(self, node: Node) -> None:
        """Call back for this node no longer."""
        self._nodes.remove(node)
        for readable in node.readables:
            if (attached := self._attached.pop(id(readable), None)) is not None:
                self._waits.detach(attached[1])

    def wake(self) -> None:
        """End a wait, from any thread."""
        self._waker.set(True)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Call back once, waiting so long for a reason; None waits for ever, 0 not at all.

        Raises ExternalShutdownException after ``shutdown``, and whatever the callback raises.
        """
        _require_domain()
        work = next(self._work)
        if work is None:
            self._wait(timeout_sec)
            work = next(self._work)
        if work is not None:
            work()

    def has_work(self) -> bool:
        """Return whether a callback is due."""
        return bool(self._waits.there(0))

    def spin(self) -> None:
        """Call back until ``shutdown``."""
        while ok():
            self.spin_once()

    def shutdown(self) -> None:
        """Let go of all nodes."""
        for node in list(self._nodes):
            self.remove_node(node)
        self._context.wakers.remove(self._waker)

    def _rounds(self) -> Iterator[Callable[[], object] | None]:
        """Yield one callback of each source in turn, and None when no source has any."""
        while True:
            idle = True
            for source in self._sources():
                if (work := source.take()) is not None:
                    idle = False
                    yield work
            if idle:
                yield None

    def _sources(self) -> list[Readable]:
        """Return the entities that are ready."""
        there = self._waits.there(0) if self._there is None else self._there
        self._there = None
        if id(self._waker) in there:
            self._waker.take()
            self._attach()
        return [self._attached[key][0] for key in there if key in self._attached]

    def _wait(self, timeout_sec: float | None) -> None:
        end = inf if timeout_sec is None or timeout_sec < 0 else time.monotonic() + timeout_sec
        while True:
            _require_domain()
            left = end - time.monotonic()
            self._there = self._waits.there(round(NANOSECONDS * max(0.0, min(left, SLICE))))
            if self._there or left <= SLICE:
                return

    def _attach(self) -> None:
        for node in self._nodes:
            for readable in node.readables:
                if id(readable) not in self._attached:
                    condition = readable.reader.any_sample()
                    self._waits.add(condition, id(readable))
                    self._attached[id(readable)] = readable, condition


def _require_domain() -> None:
    if not ok():
        raise ExternalShutdownException("the domain was left by shutdown()")
