"""A viewer that is no part of a scan: it reads all topics of blocks, and may cease to read."""

import os
import signal
import time
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from afm_scan_bench.faults.injection.processes import FORKING, Forked
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.middleware import PROFILES, RANGE
from afm_scan_ros.nodes.topics import (
    BLOCKS,
    MODEL_RESIDUAL,
    NODE_STATE,
    SCAN_INFO,
    TRACKING_ERROR,
)

TOPICS = (*BLOCKS.values(), TRACKING_ERROR, MODEL_RESIDUAL, NODE_STATE, SCAN_INFO)
ROS_DEFAULT = QoSProfile(depth=10)
"""Reliable, volatile, keep last 10: what a subscriber has that asks for nothing else."""
BLOCK = signal.SIGUSR1
"""Makes the next callback last for ever."""


class Viewer(Node):
    """Reads every topic twice: as a recorder does, and with ROS's default quality of service."""

    def __init__(self) -> None:
        super().__init__("viewer")
        self._blocked = False
        signal.signal(BLOCK, self._block)
        for topic in TOPICS:
            for quality in (topic.reader, ROS_DEFAULT):
                self.create_subscription(topic.kind, topic.name, self._see, quality)

    def _block(self, *_: object) -> None:
        self._blocked = True

    def _see(self, _: Message) -> None:
        while self._blocked:
            time.sleep(1.0)


def start(output: Path) -> Forked:
    """Start a viewer in this process's environment; what it writes to stderr is in ``output``."""
    process = FORKING.Process(target=_view, args=(dict(os.environ), output), daemon=True)
    process.start()
    return Forked("viewer", process, output)


def _view(environment: dict[str, str], output: Path) -> None:
    """Join with what ROS itself sets of DDS, as RViz does, not with what our nodes set."""
    os.environ.update(environment)
    os.environ.pop(PROFILES, None)
    os.environ[RANGE] = "LOCALHOST"
    os.dup2(os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    rclpy.spin(Viewer())
