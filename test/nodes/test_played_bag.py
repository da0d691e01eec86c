"""Nodes that only read follow a bag that is played, however slowly; a scan they watch as ever."""

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from attrs import evolve
from rclpy.node import Node

from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.cli.processes import NodeProcess
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.streams import end, part
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.messages import Message, info_message, state_message
from afm_scan_ros.nodes.peers import RUNNING, Report
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, DRIVE, NODE_STATE, SCAN_INFO
from afm_scan_ros.nodes.topics import TRACKING_ERROR as ERRORS
from afm_scan_ros.nodes.tracking_monitor import TrackingMonitor
from helpers.in_process import SPEC, scan
from helpers.ros import PATIENCE, joined, publisher, until

pytestmark = pytest.mark.long

READERS = ("tracking_monitor", "scan_imager", "residual_monitor")
SILENCE = 1.0
"""Seconds that a node of a scan may be silent."""
PAUSE = 3 * SILENCE
BLOCK = 5000
PAUSE_AT = 4 * BLOCK
INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source",))


@pytest.fixture
def player() -> Iterator[Node]:
    with joined():
        made = Node("rosbag2_player")
        yield made
        made.destroy_node()


@pytest.fixture
def readers(start: Callable[..., NodeProcess]) -> dict[str, NodeProcess]:
    return {name: start(name, liveness_timeout_s=SILENCE) for name in READERS}


@pytest.mark.parametrize("states", [False, True])
def test_a_pause_ends_no_reader(
    player: Node, readers: dict[str, NodeProcess], *, states: bool
) -> None:
    """Neither do the states of the scan's nodes, where the bag holds them."""
    lines: list[Message] = []
    player.create_subscription(ERRORS.kind, ERRORS.name, lines.append, ERRORS.reader)
    done = scan(SPEC, ("creep", "hysteresis", "vibration"))
    streams = {DESIRED: done.desired, DRIVE: done.drive, ACHIEVED: done.measured}
    gone = ("trajectory_generator", *READERS)
    info = evolve(info_of_scan(SPEC, "played", 10**18), nodes=gone, window=4 * BLOCK)
    topics = {topic: publisher(player, topic) for topic in (SCAN_INFO, NODE_STATE, *streams)}
    wanted = {DESIRED: 2, DRIVE: 2, ACHIEVED: 3, SCAN_INFO: 3}
    until(lambda: all(topics[t].get_subscription_count() == n for t, n in wanted.items()), player)
    topics[SCAN_INFO].publish(info_message(info))
    for first in range(0, done.desired.x.size, BLOCK):
        for topic, stream in streams.items():
            stop = min(end(stream), first + BLOCK)
            block = part(stream, first, stop)
            last = stop == end(stream)
            topics[topic].publish(encode_block(topic.type_name, info, block, last=last))
        for name in READERS if states else ():
            state = state_message(info, name, RUNNING, abs(PAUSE_AT - first), "")
            topics[NODE_STATE].publish(state)
        if first == PAUSE_AT:
            time.sleep(PAUSE)
    until(lambda: all(node.process.poll() is not None for node in readers.values()), player)
    assert [node.last_words() for node in readers.values() if node.process.returncode] == []
    until(lambda: len(lines) == SPEC.lines, player)


@pytest.mark.parametrize("announced", [True, False])
def test_blocks_wait_for_the_announcement_of_their_scan(player: Node, *, announced: bool) -> None:
    monitor = TrackingMonitor()
    info = info_of_scan(SPEC, "played", 10**18)
    topics = {topic: publisher(player, topic) for topic in (SCAN_INFO, DESIRED, ACHIEVED)}
    until(lambda: all(monitor.count_publishers(name) for name in monitor.inputs), monitor)
    for topic in (DESIRED, ACHIEVED):
        still = Trace(0, SPEC.sample_period, np.zeros(BLOCK), np.zeros(BLOCK))
        topics[topic].publish(encode_block(topic.type_name, info, still, last=False))
    until(lambda: monitor.calls == 2, monitor)
    monitor.step()
    if announced:
        topics[SCAN_INFO].publish(info_message(info))
        until(lambda: monitor.next_sample == BLOCK, monitor)
    else:
        time.sleep(monitor.safety.discovery)
        with pytest.raises(ScanError, match="a block came before scan_info"):
            monitor.step()
    monitor.destroy_node()


def test_the_source_of_a_scan_is_missed_where_it_is_there(player: Node) -> None:
    """``player`` joins the domain."""
    monitor = TrackingMonitor()
    monitor.begin(INFO)
    monitor.peers.hear(Report("source", INFO.scan_id, RUNNING, 0, "", time.monotonic()))
    late = time.monotonic() + PATIENCE
    monitor.watch(late)
    assert player.get_node_names()
    source = Node("source")
    publisher(source, SCAN_INFO)
    until(lambda: "source" in player.get_node_names(), player)
    with pytest.raises(ScanError, match=r"^source has been silent for 5 s$"):
        monitor.watch(late)
    source.destroy_node()
    until(lambda: "source" not in player.get_node_names(), player)
    with pytest.raises(ScanError, match=r"^source has been silent for 5 s$"):
        monitor.watch(late)
    monitor.destroy_node()
