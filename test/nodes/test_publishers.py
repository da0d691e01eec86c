"""Each topic of a scan has one publisher; a block of another moves nothing and is not recorded."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import rclpy
from attrs import evolve
from rclpy._rclpy_pybind11 import RCLError
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import Image

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.safety import SafetySettings
from afm_scan_ros.nodes.block_source import TrajectoryGenerator
from afm_scan_ros.nodes.messages import Message, info_message, state_message
from afm_scan_ros.nodes.peers import FAILED, READY, RUNNING, Report
from afm_scan_ros.nodes.run import hear
from afm_scan_ros.nodes.scan_node import ScanNode
from afm_scan_ros.nodes.scan_recorder import ScanRecorder
from afm_scan_ros.nodes.scanner_node import PiezoscannerSim
from afm_scan_ros.nodes.topics import DESIRED, DRIVE, NODE_STATE, SCAN_INFO, NodeTopic
from helpers.ros import PATIENCE, joined, publisher, until

QUARTER = 1000
INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4 * QUARTER, window=4 * QUARTER)
OWN, FORGED = 0.5, 4.9
"""Drive (V) of the scan and of another publisher."""


class Scan:
    """A node that is tested, and what it hears of a source and a monitor."""

    def __init__(self, kind: type[ScanNode], topic: NodeTopic) -> None:
        self.node, self.topic = kind(), topic
        self.info = evolve(INFO, nodes=("source", kind.NAME, "monitor"))
        self.node.hear_others()
        self.talking = ["source", "monitor"]
        self.state = READY
        self.source = Node("source")
        self._state = publisher(self.source, NODE_STATE)
        self._blocks = publisher(self.source, topic)
        publisher(self.source, SCAN_INFO).publish(info_message(self.info))
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def until(self, holds: Callable[[], object]) -> None:
        """Let the node live until something holds."""
        deadline = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < deadline, f"waited in vain: {self.node.reason}"
            for name in self.talking:
                self._state.publish(state_message(self.info, name, self.state, 0, ""))
            hear(self.node, self._executor, 0.01)
            self.node.tick()

    def quarter(self, first: int, value: float) -> Message:
        """Return a quarter of the scan."""
        samples = np.full(QUARTER, value)
        block = Trace(first, INFO.sample_period, samples, samples)
        last = first + QUARTER == INFO.total_samples
        return encode_block(self.topic.type_name, INFO, block, last=last)

    def begin(self) -> None:
        """Send the first quarter."""
        self.until(lambda: self.node.ready)
        self.state = RUNNING
        self._blocks.publish(self.quarter(0, OWN))
        self.until(lambda: self.node.next_sample == QUARTER)

    def end(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self.node.destroy_node()
        self.source.destroy_node()


Begin = Callable[[type[ScanNode], NodeTopic], Scan]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    """Join the domain with the parameters of all nodes that are tested."""
    given = {
        "bag": str(tmp_path / "bag"),
        "topics": [DESIRED.name],
        "output_log": str(tmp_path / "outputs.txt"),
        "required_nodes": ["first", "second"],
        "min_subscriptions": 0,
        "min_true_subscriptions": 0,
        "upstream_timeout_s": 5.0,
        "liveness_timeout_s": 5.0,
        "progress_timeout_s": 5.0,
    }
    made: list[Scan] = []

    def run(kind: type[ScanNode], topic: NodeTopic) -> Scan:
        made.append(Scan(kind, topic))
        return made[-1]

    with joined(**given):
        yield run
        for scan in made:
            scan.end()


@contextmanager
def one_more(
    topic: NodeTopic, kind: type[Message] | None = None, name: str = "another"
) -> Iterator[Callable[[Message], None]]:
    """Publish a topic once more, as another process does: Fast DDS has one type in each."""
    context = Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node(name, context=context)
    made = node.create_publisher(kind or topic.kind, topic.name, topic.writer)

    def send(message: Message) -> None:
        # What Fast DDS was given before it knew a reader can keep it from delivering what follows.
        if made.get_subscription_count():
            with suppress(RCLError):  # where its history is full
                made.publish(message)

    try:
        yield send
    finally:
        node.destroy_node()
        context.shutdown()


def names(node: ScanNode) -> list[str]:
    """Return the nodes that publish the desired displacement."""
    found = node.get_publishers_info_by_topic(DESIRED.name)
    return sorted(each.node_name for each in found)


def test_a_node_is_ready_once_it_counts_one_publisher(begin: Begin) -> None:
    """That of a process that was killed is counted for a while.

    It is found and named before the node looks, or the node is ready too early.
    """
    with one_more(DESIRED):
        scan = begin(ScanRecorder, DESIRED)
        said = "waits for one publisher of /desired_displacement, not 2 (another, source)"
        until(lambda: names(scan.node) == ["another", "source"])
        scan.until(lambda: scan.node.reason == said)
        assert not scan.node.ready
    scan.until(lambda: scan.node.ready)


@pytest.mark.parametrize("kind", [DESIRED.kind, DRIVE.kind, Image])
def test_one_that_comes_during_the_scan_ends_it_by_name(begin: Begin, kind: type[Message]) -> None:
    scan = begin(ScanRecorder, DESIRED)
    scan.begin()
    said = r"^/desired_displacement has another publisher \(another\): stop all but one$"
    with one_more(DESIRED, kind), pytest.raises(ScanError, match=said):
        scan.until(lambda: False)


def test_a_second_source_is_refused_at_once_by_name(begin: Begin) -> None:
    scan = begin(ScanRecorder, DESIRED)
    scan.until(lambda: scan.node.ready)
    said = "/scan_info announces scan 'other' during scan 'tested': stop all sources but one"
    other = info_message(evolve(INFO, scan_id="other"))
    with one_more(SCAN_INFO, name="source") as send, pytest.raises(ScanError, match=f"^{said}$"):
        scan.until(lambda: send(other))


def test_a_node_is_ready_once_it_has_heard_all_others(begin: Begin) -> None:
    """Before, a reader that is counted may be of a node that was killed, in place of its own."""
    scan = begin(ScanRecorder, DESIRED)
    scan.talking.remove("monitor")
    scan.until(lambda: scan.node.reason == "waits for the state of monitor")
    assert not scan.node.ready
    scan.talking.append("monitor")
    scan.until(lambda: scan.node.ready)


@pytest.mark.parametrize(
    ("kind", "topic"), [(PiezoscannerSim, DRIVE), (ScanRecorder, DESIRED)], ids=["scanner", "bag"]
)
@pytest.mark.parametrize("running", [False, True])
def test_a_forged_block_neither_moves_the_scanner_nor_enters_the_bag(
    begin: Begin, tmp_path: Path, kind: type[ScanNode], topic: NodeTopic, *, running: bool
) -> None:
    """It is the very one that is due: of the scan, at its next sample."""
    scan = begin(kind, topic)
    scan.talking.remove("monitor")  # for which the node then waits
    scan.until(lambda: scan.node.reason == "waits for the state of monitor")
    if running:
        scan.talking.append("monitor")
        scan.begin()
    due = QUARTER if running else 0
    said = "another publisher" if running else "a block came while this node waits for"
    with one_more(topic) as send, pytest.raises(ScanError, match=said) as raised:
        scan.until(lambda: send(scan.quarter(due, FORGED)))
    scan.node.fail(raised.value)
    assert (scan.node.state, scan.node.next_sample) == (FAILED, due)
    if kind is ScanRecorder:
        assert (tmp_path / "bag").exists() == running
        assert not running or set(read_scan(tmp_path / "bag").whole(topic.name).x) == {OWN}
    else:
        outputs = written(tmp_path / "outputs.txt")
        assert outputs.max(initial=0.0) == (OWN if running else 0.0)
        assert not running or not outputs[-1].any()


def written(log: Path) -> np.ndarray:
    """Outputs (V) of both axes; none where none was written."""
    text = log.read_text("utf-8") if log.exists() else ""
    return np.loadtxt(text.splitlines(), ndmin=2)[:, 2:] if text else np.empty((0, 2))


@pytest.mark.usefixtures("begin")
def test_a_scan_begins_once_each_has_spoken_after_the_last_was_ready(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that was ready may have been killed since, and be on its way back."""
    monkeypatch.setattr(ScanNode, "safety", SafetySettings(doubt=PATIENCE))
    generator = TrajectoryGenerator()
    until(lambda: not generator.crowded())  # rmw tells even a node's own publishers by and by

    def say(name: str) -> str:
        report = Report(name, generator.scan.scan_id, READY, 0, "", time.monotonic())
        generator.peers.hear(report)
        generator.step()
        return generator.state

    assert [say(name) for name in ("first", "second", "second")] == [READY] * 3
    assert say("first") == RUNNING
    generator.destroy_node()
