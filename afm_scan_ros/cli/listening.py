"""Listens to the nodes of a scan, or for a scanner's node that somebody else started; needs ROS."""

import os
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager

import rclpy
from attrs import define, field
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from afm_scan_ros.bag.typestore import Message
from afm_scan_ros.cli.progress import ScanProgress, showing, working
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.nodes.peers import DONE, READY, RUNNING
from afm_scan_ros.nodes.run import join
from afm_scan_ros.nodes.topics import ACHIEVED, NODE_STATE, SCAN_INFO, TRUE

MOMENT = 0.1
"""Seconds of listening at once."""


@define(eq=False)
class ScanWatch:
    """Follows scan_info and node_state; shows the slowest node's progress and all reasons."""

    shown: ScanProgress
    _total: int = field(default=0, init=False)
    _slowest: dict[str, int] = field(factory=dict, init=False)
    _told: set[str] = field(factory=set, init=False)

    def meet(self, info: Message) -> None:
        """Learn how long the scan is."""
        self._total = info.total_samples

    def hear(self, state: Message) -> None:
        """Show a node's state, also where its last state is the first that is heard."""
        if state.state in (RUNNING, DONE) and state.reason:
            self.tell(state.node, state.reason)
        self._slowest[state.node] = state.next_sample
        done = min(self._slowest.values())
        if not done:
            self.shown.doing(f"{state.node}: {state.reason or state.state}")
        elif self._total:
            self.shown.moved(done, self._total)

    def tell(self, node: str, news: str) -> None:
        """Show what a node says, once."""
        if (text := f"{node}: {news}") not in self._told:
            self._told.add(text)
            self.shown.say(text)


@contextmanager
def watching(title: str) -> Iterator[tuple[ScanWatch, Callable[[], None]]]:
    """Show a scan while it runs; yield what follows it, and what listens for a moment."""
    join([])
    try:
        with showing(title) as shown:
            node, executor = Node("afm_scan"), SingleThreadedExecutor()
            watch = ScanWatch(shown)
            for topic, hear in ((SCAN_INFO, watch.meet), (NODE_STATE, watch.hear)):
                node.create_subscription(topic.kind, topic.name, hear, topic.reader)
            executor.add_node(node)
            yield watch, lambda: executor.spin_once(timeout_sec=MOMENT)
            executor.shutdown()
    finally:
        rclpy.shutdown()


def found_scanner(names: Collection[str], longest: float) -> tuple[str, bool]:
    """Return the name of the first scanner that waits for a scan, and whether it knows the truth.

    All of its topics are there then. Raises InputError where there is none within ``longest`` s.
    """
    join([])
    try:
        return _found(Node("scanner_search"), names, longest)
    finally:
        rclpy.try_shutdown()


def _found(node: Node, names: Collection[str], longest: float) -> tuple[str, bool]:
    waiting: list[str] = []

    def hear(message: Message) -> None:
        if message.node in names and message.state == READY and not message.scan_id:
            waiting.append(message.node)

    node.create_subscription(NODE_STATE.kind, NODE_STATE.name, hear, NODE_STATE.reader)
    achieved, true = (node.resolve_topic_name(topic.name) for topic in (ACHIEVED, TRUE))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + longest
    with working("--scanner external") as report:
        while not waiting or node.count_publishers(achieved) != 1:
            executor.spin_once(timeout_sec=MOMENT)
            if (left := deadline - time.monotonic()) < 0.0:
                domain = os.environ.get("ROS_DOMAIN_ID", "0")
                raise InputError(
                    f"--scanner external: no scanner waits for a scan in ROS domain {domain}:"
                    f" start {' or '.join(names)} there, and no other scan; or --wait longer"
                )
            report(f"waits for a scanner node, for {left:.0f} s at most")
    known = node.count_publishers(true) > 0
    executor.shutdown()
    node.destroy_node()
    return waiting[-1], known
