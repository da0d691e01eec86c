"""A publisher that was killed is counted for a while; no scan begins or ends because of it."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros import ros
from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes import block_source, scan_node
from afm_scan_ros.nodes.messages import block_message, info_message, state_message
from afm_scan_ros.nodes.scan_recorder import ScanRecorder
from afm_scan_ros.nodes.topics import (
    DESIRED,
    DONE,
    NODE_STATE,
    READY,
    RUNNING,
    SCAN_INFO,
    NodeTopic,
    Report,
)
from afm_scan_ros.nodes.trajectory_generator import TrajectoryGenerator

PATIENCE = 60.0
NODES = ("source", "scan_recorder", "monitor")
INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=NODES)
BLOCKS = "/desired_displacement"


@pytest.fixture(autouse=True)
def joined(tmp_path: Path) -> Iterator[None]:
    """Join the domain with the parameters of both nodes that are tested."""
    given = [
        f"bag:={tmp_path / 'bag'}",
        "topics:=[desired_displacement]",
        "required_nodes:=[first, second]",
        "min_subscriptions:=0",
    ]
    words = [word for pair in given for word in ("-p", pair)]
    ros.init(
        args=["test", "--ros-args", *words], signal_handler_options=ros.SignalHandlerOptions.NO
    )
    yield
    ros.shutdown()


@pytest.fixture
def scan() -> Iterator["Scan"]:
    made = Scan()
    yield made
    made.recorder.destroy_node()
    made.source.destroy_node()


class Scan:
    """A recorder, and what it hears of a source and a monitor."""

    def __init__(self) -> None:
        self.recorder = ScanRecorder()
        self.recorder.hear_others()
        self.talking = ["source", "monitor"]
        self.source = ros.Node("source")
        self._state = publisher(self.source, NODE_STATE)
        self._blocks = publisher(self.source, DESIRED)
        publisher(self.source, SCAN_INFO).publish(info_message(INFO))
        self._executor = ros.SingleThreadedExecutor()
        self._executor.add_node(self.recorder)

    def until(self, holds: Callable[[], bool]) -> None:
        """Let the recorder live until something holds."""
        deadline = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < deadline, f"waited in vain: {self.recorder.reason}"
            for name in self.talking:
                self._state.publish(state_message(INFO, name, READY, 0, ""))
            self._executor.spin_once(timeout_sec=0.01)
            self.recorder.tick()

    def send(self, first: int) -> None:
        """Publish a quarter of the scan."""
        block = Trace(first, INFO.sample_period, np.zeros(1000), np.zeros(1000))
        last = first + 1000 == INFO.total_samples
        self._blocks.publish(block_message(DESIRED.kind, INFO, block, last=last))

    def counted(self) -> int:
        """Count the publishers of the blocks, as the recorder does."""
        return self.recorder.count_publishers(BLOCKS)


def publisher(node: ros.Node, topic: NodeTopic) -> ros.Publisher:
    return node.create_publisher(topic.kind, topic.name, topic.writer)


def one_more(topic: NodeTopic) -> ros.Node:
    """Publish a topic once more, under the name of the node that does so already."""
    twin = ros.Node("source")
    publisher(twin, topic)
    return twin


def test_a_node_is_ready_for_as_long_as_it_counts_one_publisher(scan: Scan) -> None:
    scan.until(lambda: scan.recorder.ready)
    killed = one_more(DESIRED)
    scan.until(lambda: not scan.recorder.ready)
    assert scan.recorder.reason == f"waits for one publisher of {BLOCKS}, not 2"
    killed.destroy_node()
    scan.until(lambda: scan.recorder.ready)


def test_one_that_is_counted_within_the_scan_ends_it_only_if_it_stays(
    scan: Scan, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan.until(lambda: scan.recorder.ready)
    scan.send(0)
    scan.until(lambda: scan.recorder.state == RUNNING)
    killed = one_more(DESIRED)
    scan.until(lambda: scan.counted() == 2)
    noticed = time.monotonic() + 2 * scan_node.HEARTBEAT
    scan.until(lambda: time.monotonic() > noticed)
    killed.destroy_node()
    scan.until(lambda: scan.counted() == 1)
    for first in (1000, 2000, 3000):
        scan.send(first)
    scan.until(lambda: scan.recorder.state == DONE)
    monkeypatch.setattr(scan_node, "AFTERLIFE", 0.0)
    living = one_more(DESIRED)
    with pytest.raises(ScanError, match=f"^{BLOCKS} has 2 publishers: stop all but one$"):
        scan.until(lambda: False)
    living.destroy_node()


def test_a_second_source_is_refused_at_once_by_name(scan: Scan) -> None:
    scan.until(lambda: scan.recorder.ready)
    other = ros.Node("source")
    publisher(other, SCAN_INFO).publish(info_message(evolve(INFO, scan_id="other")))
    said = "/scan_info announces scan 'other' during scan 'tested': stop all sources but one"
    with pytest.raises(ScanError, match=f"^{said}$"):
        scan.until(lambda: False)


def test_a_node_is_ready_once_it_has_heard_all_others(scan: Scan) -> None:
    """Before, a reader that is counted may be of a node that was killed, in place of its own."""
    scan.talking.remove("monitor")
    scan.until(lambda: scan.recorder.reason == "waits for the state of monitor")
    assert not scan.recorder.ready
    scan.talking.append("monitor")
    scan.until(lambda: scan.recorder.ready)


def test_a_scan_begins_once_each_has_spoken_after_the_last_was_ready(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that was ready may have been killed since, and be on its way back."""
    monkeypatch.setattr(block_source, "DOUBT", PATIENCE)
    generator = TrajectoryGenerator()

    def say(name: str) -> str:
        report = Report(name, generator.scan.scan_id, READY, 0, "", time.monotonic())
        generator.peers.hear(report)
        generator.step()
        return generator.state

    assert [say(name) for name in ("first", "second", "second")] == [READY] * 3
    assert say("first") == RUNNING
