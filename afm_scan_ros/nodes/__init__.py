"""The nodes, and how a process starts one.

A node's modules take seconds to import, so this one imports little. A signal in this time ends the
process at once, without a traceback and with status 0: nothing has begun that could fail.
"""

import os
import signal
import sys
import threading
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

NODES = {
    "trajectory_generator": "block_source",
    "excitation_generator": "block_source",
    "inversion_compensator": "inversion_compensator",
    "piezoscanner_sim": "scanner_node",
    "scanner_driver": "scanner_node",
    "scan_recorder": "scan_recorder",
    "scan_imager": "scan_imager",
    "tracking_monitor": "tracking_monitor",
    "residual_monitor": "residual_monitor",
}
"""Each node, and the module of its class, as ``ScanImager`` of ``scan_imager``."""

_INPUT = 0


def has_rclpy() -> bool:
    """Return whether ROS's client library is there."""
    return find_spec("rclpy") is not None


def lacking_ros() -> str:
    """Return why no node can run here; nothing where one can."""
    if not has_rclpy():
        return "ROS 2 is not installed, or its setup.bash is not sourced"
    if find_spec("afm_scan_ros.msg") is None:
        return "ROS 2 is there, but the messages of afm_scan_ros are not built: run colcon build"
    return ""


def main() -> int:
    """Run the node that is named as the script; return its status."""
    return start(Path(sys.argv[0]).stem)


def start(name: str) -> int:
    """Import and run a node; return its status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    status: int = import_module("afm_scan_ros.nodes.run").run_node(name)
    return status


def end_with_parent() -> None:
    """End this process, as SIGTERM does, when the pipe on its standard input closes.

    The parent holds the other end and writes nothing, so it closes with the parent alone.
    """
    threading.Thread(target=_await_end, daemon=True).start()


def _await_end() -> None:
    """Read past sys.stdin, whose lock a thread would still hold when the interpreter ends."""
    while os.read(_INPUT, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
