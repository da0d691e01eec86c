"""What a node says on /diagnostics: at every change, once a second, and what matters."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros import ros
from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.cli.processes import NodeCommand, NodeProcess
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.block_consumer import StreamReader
from afm_scan_ros.nodes.messages import block_message
from afm_scan_ros.nodes.topics import DESIRED, DIAGNOSTICS, PERIOD, RUNNING, NodeTopic

PATIENCE = 60.0
INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source",))


class Reader(StreamReader):
    """Reads blocks and takes its time."""

    NAME = "slow_reader"

    def __init__(self) -> None:
        super().__init__()
        self.read([DESIRED])

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - only how long it takes counts
        time.sleep(0.01)


class Operator(ros.Node):
    """Keeps the last status of each node, and how many there were."""

    def __init__(self) -> None:
        super().__init__("operator")
        self.last: dict[str, ros.Message] = {}
        self.count = 0
        topic = DIAGNOSTICS
        self.create_subscription(topic.kind, topic.name, self._hear, topic.reader)
        self._executor = ros.SingleThreadedExecutor()
        self._executor.add_node(self)

    def _hear(self, message: ros.Message) -> None:
        self.count += 1
        assert abs(message.header.stamp.sec - time.time()) < PATIENCE
        self.last.update({status.name: status for status in message.status})

    def until(self, holds: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < deadline, self.last
            self._executor.spin_once(timeout_sec=0.05)


@pytest.fixture
def operator() -> Iterator[Operator]:
    ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
    made = Operator()
    yield made
    made.destroy_node()
    ros.shutdown()


@pytest.fixture
def reader(operator: Operator) -> Iterator[Reader]:
    assert operator.count == 0
    made = Reader()
    yield made
    made.destroy_node()


def test_a_node_says_how_it_is(operator: Operator, reader: Reader) -> None:
    name, status = "slow_reader: scan", ros.DiagnosticStatus
    operator.until(lambda: reader.tick() or name in operator.last)
    said = operator.last[name]
    assert (said.level, said.message, list(said.values)) == (
        status.OK,
        "ready: waits for scan_info",
        [],
    )
    reader.begin(INFO)
    block = Trace(0, INFO.sample_period, np.zeros(500), np.zeros(500))
    publisher = operator.create_publisher(DESIRED.kind, DESIRED.name, DESIRED.writer)
    publisher.publish(block_message(DESIRED.kind, INFO, block, last=False))
    hearing = ros.SingleThreadedExecutor()
    hearing.add_node(reader)
    while reader.next_sample == 0:
        hearing.spin_once(timeout_sec=PATIENCE)
    reader.go(RUNNING, "an alarm")
    operator.until(lambda: operator.last[name].level == status.WARN)
    values = {each.key: each.value for each in operator.last[name].values}
    assert operator.last[name].message == "running: an alarm"
    assert values.pop("scan_id") == "tested"
    assert 0.0 < float(values.pop("real_time_margin")) < 5.0  # 50 ms of scan in over 10 ms
    assert values == {"next_sample": "500", "total_samples": "4000"}
    reader.fail(ScanError("it broke"))
    operator.until(lambda: operator.last[name].level == status.ERROR)
    assert operator.last[name].message == "failed: it broke"
    hearing.shutdown()


def test_nothing_new_is_said_once_a_second(operator: Operator, reader: Reader) -> None:
    reader.report()
    operator.until(lambda: operator.count == 1)
    began = time.monotonic()
    while operator.count < 3:
        reader.report()
        operator._executor.spin_once(timeout_sec=0.01)  # noqa: SLF001 - the test's own
        assert time.monotonic() < began + PATIENCE
    assert time.monotonic() - began >= PERIOD


def test_a_node_that_cannot_be_made_says_why(operator: Operator, tmp_path: Path) -> None:
    command = NodeCommand("piezoscanner_sim", {"plant_file": str(tmp_path / "none.yaml")})
    node = NodeProcess.start(command)
    operator.until(lambda: "piezoscanner_sim: scan" in operator.last)
    said = operator.last["piezoscanner_sim: scan"]
    assert said.level == ros.DiagnosticStatus.ERROR
    assert "none.yaml" in said.message
    assert node.process.wait(PATIENCE) == 2
    node.process.communicate()
    node.output.close()
