"""Listens to the nodes of a scan; needs ROS."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from attrs import define, field
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from afm_scan_ros.bag.typestore import Message
from afm_scan_ros.cli.progress import ScanProgress, showing
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.run import join
from afm_scan_ros.nodes.topics import NODE_STATE, SCAN_INFO

MOMENT = 0.1
"""Seconds of listening at once."""


@define(eq=False)
class ScanWatch:
    """Follows scan_info and node_state; shows the slowest node's progress and all reasons."""

    _shown: ScanProgress
    _total: int = field(default=0, init=False)
    _slowest: dict[str, int] = field(factory=dict, init=False)
    _last_reason: str = field(default="", init=False)

    def listen(self, node: Node) -> None:
        """Hear what a node of this process receives."""
        for topic, hear in ((SCAN_INFO, self.meet), (NODE_STATE, self.hear)):
            node.create_subscription(topic.kind, topic.name, hear, topic.reader)

    def meet(self, info: Message) -> None:
        """Learn how long the scan is."""
        self._total = info.total_samples

    def hear(self, state: Message) -> None:
        """Show a node's state."""
        if state.state == RUNNING and state.reason not in ("", self._last_reason):
            self._last_reason = state.reason
            self._shown.say(f"{state.node}: {state.reason}")
        self._slowest[state.node] = state.next_sample
        done = min(self._slowest.values())
        if not done:
            self._shown.doing(f"{state.node}: {state.reason or state.state}")
        elif self._total:
            self._shown.moved(done, self._total)


@contextmanager
def watching(title: str) -> Iterator[Callable[[], None]]:
    """Show a scan while it runs; yield a function that listens for a moment."""
    join([])
    try:
        with showing(title) as shown:
            node, executor = Node("afm_scan"), SingleThreadedExecutor()
            ScanWatch(shown).listen(node)
            executor.add_node(node)
            yield lambda: executor.spin_once(timeout_sec=MOMENT)
            executor.shutdown()
    finally:
        rclpy.shutdown()
