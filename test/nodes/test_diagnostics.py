"""What a node says on /diagnostics: at every change, once a second, and what matters."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.cli.processes import NodeProcess
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.block_consumer import StreamReader
from afm_scan_ros.nodes.diagnostics import PERIOD
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.topics import DESIRED, DIAGNOSTICS, NodeTopic
from helpers.ros import PATIENCE, joined, publisher, until

INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source",))


class Reader(StreamReader):
    """Reads blocks and takes its time."""

    NAME = "slow_reader"

    def __init__(self) -> None:
        super().__init__()
        self.read([DESIRED])

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:  # noqa: ARG002 - only how long it takes counts
        time.sleep(0.01)


class Operator(Node):
    """Keeps the last status of each node, and how many there were."""

    def __init__(self) -> None:
        super().__init__("operator")
        self.last: dict[str, Message] = {}
        self.count = 0
        topic = DIAGNOSTICS
        self.create_subscription(topic.kind, topic.name, self._hear, topic.reader)

    def _hear(self, message: Message) -> None:
        self.count += 1
        assert abs(message.header.stamp.sec - time.time()) < PATIENCE
        self.last.update({status.name: status for status in message.status})

    def until(self, holds: Callable[[], bool]) -> None:
        until(holds, self)


@pytest.fixture
def operator() -> Iterator[Operator]:
    with joined():
        made = Operator()
        yield made
        made.destroy_node()


@pytest.fixture
def reader(operator: Operator) -> Iterator[Reader]:
    assert operator.count == 0
    made = Reader()
    yield made
    made.destroy_node()


def test_a_node_says_how_it_is(operator: Operator, reader: Reader) -> None:
    name, status = "slow_reader: scan", DiagnosticStatus
    operator.until(lambda: reader.report() or name in operator.last)
    said = operator.last[name]
    assert (said.level, said.message, list(said.values)) == (
        status.OK,
        "ready: waits for scan_info",
        [],
    )
    reader.begin(INFO)
    block = Trace(0, INFO.sample_period, np.zeros(500), np.zeros(500))
    blocks = publisher(operator, DESIRED)
    until(blocks.get_subscription_count, operator)
    blocks.publish(encode_block(DESIRED.type_name, INFO, block, last=False))
    until(lambda: reader.next_sample, reader)
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


def test_nothing_new_is_said_once_a_second(operator: Operator, reader: Reader) -> None:
    reader.report()
    operator.until(lambda: operator.count == 1)
    began = time.monotonic()
    operator.until(lambda: reader.report() or operator.count == 3)
    assert time.monotonic() - began >= PERIOD


def test_a_node_that_cannot_be_made_says_why(
    operator: Operator, start: Callable[..., NodeProcess], tmp_path: Path
) -> None:
    node = start("piezoscanner_sim", plant_file=str(tmp_path / "none.yaml"))
    operator.until(lambda: "piezoscanner_sim: scan" in operator.last)
    said = operator.last["piezoscanner_sim: scan"]
    assert said.level == DiagnosticStatus.ERROR
    assert "none.yaml" in said.message
    assert node.process.wait(PATIENCE) == 2
