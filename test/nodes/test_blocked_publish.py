"""A publish that blocks with the interpreter locked, as rclpy's does, keeps no drive up."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.cli.processes import NodeCommand, NodeProcess
from afm_scan_ros.ros.common import URI
from afm_scan_ros.ros.cyclone import HOLDS_LOCK

PATIENCE = 60.0
SCANNER, SOURCE = "piezoscanner_sim", "excitation_generator"
CYCLONE = "rmw_cyclonedds_cpp"
SMALL_CACHE = (
    "<CycloneDDS><Domain><Internal><Watermarks><WhcHigh>64kB</WhcHigh><WhcHighInit>64kB"
    "</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks></Internal></Domain></CycloneDDS>"
)
"""Settings with which a stopped reader blocks the writer after four blocks."""
RECORD = {
    "kind": "hysteresis",
    "required_nodes": [SCANNER],
    "min_subscriptions": 1,
    "block_size": 500,
    "window": 5000,
}
VIEW = """\
from afm_scan_ros import ros
from afm_scan_ros.nodes.topics import ACHIEVED
ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
node, executor = ros.Node("viewer"), ros.SingleThreadedExecutor()
node.create_subscription(ACHIEVED.kind, ACHIEVED.name, lambda _: print(flush=True), ACHIEVED.reader)
executor.add_node(node)
executor.spin()
"""

Start = Callable[[str, dict[str, object]], NodeProcess]


@pytest.fixture
def start() -> Iterator[Start]:
    """Return a function that starts a node; it ends with the test."""
    started: list[NodeProcess] = []

    def run(name: str, parameters: dict[str, object]) -> NodeProcess:
        started.append(NodeProcess.start(NodeCommand(name, parameters)))
        return started[-1]

    yield run
    for node in started:
        node.process.kill()
        node.process.communicate()
        node.output.close()


@pytest.fixture
def viewer() -> Iterator[subprocess.Popen[bytes]]:
    """Return a process that writes a line for each block of displacement."""
    command = [sys.executable, "-c", VIEW]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        yield process
        process.kill()


@pytest.mark.skipif(
    find_spec("rclpy") is not None and os.environ.get("RMW_IMPLEMENTATION") != CYCLONE,
    reason="Fast DDS does not block",
)
def test_the_driver_ramps_down_while_the_node_blocks(
    start: Start, viewer: subprocess.Popen[bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(HOLDS_LOCK, "1")
    monkeypatch.setenv(URI, SMALL_CACHE)
    log = tmp_path / "outputs.txt"
    given = {"output_log": str(log), "min_subscriptions": 1, "min_true_subscriptions": 0}
    scanner, source = start(SCANNER, given), start(SOURCE, RECORD)
    assert viewer.stdout is not None
    assert viewer.stdout.readline() == b"\n"
    viewer.send_signal(signal.SIGSTOP)
    assert {node.process.wait(PATIENCE) for node in (scanner, source)} == {3}
    assert f"{SCANNER} has been silent for 0.8 s" in source.last_words()
    assert "the node has been silent for 0.3 s; drive ramped down to 0 V" in scanner.last_words()
    np.testing.assert_array_equal(np.loadtxt(log)[-1, 2:], [0.0, 0.0])
