"""Finds a scanner's node that somebody else started; needs ROS."""

import os
import time
from collections.abc import Collection

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from afm_scan_ros.bag.typestore import Message
from afm_scan_ros.cli.options import working
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.nodes.peers import READY
from afm_scan_ros.nodes.run import join
from afm_scan_ros.nodes.topics import ACHIEVED, NODE_STATE, TRUE


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
            executor.spin_once(timeout_sec=0.1)
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
