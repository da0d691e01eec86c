"""ROS in the tests' own process: joined with parameters, and heard until something holds."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from afm_scan_ros.nodes import shared_memory
from afm_scan_ros.nodes.topics import NodeTopic

PATIENCE = 120.0
"""Seconds after which a test has waited in vain."""


@contextmanager
def joined(*pairs: str, **parameters: object) -> Iterator[None]:
    """Join the domain with parameters, NAME:=VALUE or named, for all nodes of this process.

    What nodes that were killed have left in shared memory may hang it, and is cleared before.
    """
    shared_memory.clear()
    pairs += tuple(f"{name}:={json.dumps(value)}" for name, value in parameters.items())
    words = [word for pair in pairs for word in ("-p", pair)]
    rclpy.init(args=["test", "--ros-args", *words], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.shutdown()


def until(holds: Callable[[], object], *nodes: Node) -> None:
    """Call nodes back until something holds; fail if it never does."""
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    deadline = time.monotonic() + PATIENCE
    try:
        while not holds():
            assert time.monotonic() < deadline, "waited in vain"
            executor.spin_once(timeout_sec=0.05)
    finally:
        executor.shutdown()


def publisher(node: Node, topic: NodeTopic) -> Publisher:
    """Publish a topic as the nodes do."""
    return node.create_publisher(topic.kind, topic.name, topic.writer)
