"""A DDS domain of one's own on the loopback, and another process in it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from afm_scan_ros import ros

if find_spec("rclpy") is not None:  # then these test what is not in use
    collect_ignore_glob = ["test_[!t]*.py"]

PEER = Path(__file__).with_name("peer_process.py")
ROOT = Path(__file__).parents[2]
PATIENCE = 30.0

Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")  # two that run at once never meet
    monkeypatch.setenv("ROS_DOMAIN_ID", str(20 + 3 * (os.getpid() % 26) + int(worker[2:]) % 3))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)


@pytest.fixture
def start() -> Iterator[Start]:
    """Start ``peer_process.py`` with arguments; it ends with the test."""
    started: list[subprocess.Popen[str]] = []

    def run(*arguments: str) -> "subprocess.Popen[str]":
        command = [sys.executable, str(PEER), *arguments]
        path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
        environment = {**os.environ, "PYTHONPATH": path}
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment)
        started.append(process)
        return process

    yield run
    for process in started:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        process.wait()


@pytest.fixture
def node() -> Iterator[ros.Node]:
    ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
    made = ros.Node("tested")
    yield made
    if ros.ok():
        made.destroy_node()
    ros.try_shutdown()


@pytest.fixture
def spin_until(node: ros.Node) -> Callable[[Callable[[], bool]], None]:
    """Call back until something holds; fail if it never does."""
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)

    def spin(holds: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < deadline, "waited in vain"
            executor.spin_once(timeout_sec=0.05)

    return spin
