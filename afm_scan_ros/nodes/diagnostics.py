"""The status that a node publishes on ``/diagnostics``."""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from re import sub

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node

from afm_scan_ros.nodes.peers import FAILED, RUNNING
from afm_scan_ros.nodes.topics import DIAGNOSTICS

PERIOD = 1.0
"""Seconds between two messages while nothing changes."""


class Diagnostics:
    """The status of one node: an error where it failed, a warning where it runs with a reason."""

    def __init__(self, node: Node) -> None:
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: scan"
        self._publisher = node.create_publisher(
            DIAGNOSTICS.kind, DIAGNOSTICS.name, DIAGNOSTICS.writer
        )
        self._words, self._next = "", 0.0

    def publish(self, state: str, reason: str, figures: Callable[[], Mapping[str, object]]) -> None:
        """Publish the status if more than a number has changed, or the last one is a period old.

        A status that DDS refuses is dropped.
        """
        text, now = f"{state}: {reason}" if reason else state, time.monotonic()
        words = sub(r"\d+", "", text)
        if words == self._words and now < self._next:
            return
        self._words, self._next = words, now + PERIOD
        message = DiagnosticArray()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
        bad = DiagnosticStatus.ERROR if state == FAILED else DiagnosticStatus.WARN
        status = DiagnosticStatus(
            level=bad if reason and state in (FAILED, RUNNING) else DiagnosticStatus.OK,
            name=self._name,
            message=text,
            values=[KeyValue(key=key, value=str(value)) for key, value in figures().items()],
        )
        message.status = [status]
        with suppress(RCLError):
            self._publisher.publish(message)
