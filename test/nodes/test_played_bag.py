"""Nodes that only read follow a bag that is played, however slowly; a scan they watch as ever."""

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros import ros
from afm_scan_ros.bag.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.cli.processes import NodeCommand, NodeProcess
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.streams import end, part
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.messages import block_message, info_message, state_message
from afm_scan_ros.nodes.topics import (
    ACHIEVED,
    DESIRED,
    DRIVE,
    NODE_STATE,
    RUNNING,
    SCAN_INFO,
    NodeTopic,
)
from afm_scan_ros.nodes.topics import TRACKING_ERROR as ERRORS
from afm_scan_ros.nodes.tracking_monitor import TrackingMonitor
from helpers.in_process import SPEC, scan

PATIENCE = 120.0
READERS = ("tracking_monitor", "scan_imager", "residual_monitor")
SILENCE = 0.2
"""Seconds that a node of a scan may be silent."""
PAUSE = 10 * SILENCE
BLOCK = 5000
PAUSE_AT = 4 * BLOCK
INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source",))


@pytest.fixture
def player() -> Iterator[ros.Node]:
    ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
    made = ros.Node("rosbag2_player")
    yield made
    made.destroy_node()
    ros.shutdown()


@pytest.fixture
def readers() -> Iterator[dict[str, NodeProcess]]:
    given = {"liveness_timeout_s": SILENCE}
    started = {name: NodeProcess.start(NodeCommand(name, given)) for name in READERS}
    yield started
    for node in started.values():
        node.process.kill()
        node.process.communicate()
        node.output.close()


def until(node: ros.Node, holds: Callable[[], bool]) -> None:
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline, "waited in vain"
        executor.spin_once(timeout_sec=0.05)
    executor.shutdown()


def publisher(node: ros.Node, topic: NodeTopic) -> ros.Publisher:
    return node.create_publisher(topic.kind, topic.name, topic.writer)


@pytest.mark.parametrize("states", [False, True])
def test_a_pause_ends_no_reader(
    player: ros.Node, readers: dict[str, NodeProcess], *, states: bool
) -> None:
    """Neither do the states of the scan's nodes, where the bag holds them."""
    lines: list[ros.Message] = []
    player.create_subscription(ERRORS.kind, ERRORS.name, lines.append, ERRORS.reader)
    done = scan(SPEC, ("creep", "hysteresis", "vibration"))
    streams = {DESIRED: done.desired, DRIVE: done.drive, ACHIEVED: done.measured}
    gone = ("trajectory_generator", *READERS)
    info = evolve(info_of_scan(SPEC, "played", 10**18), nodes=gone, window=4 * BLOCK)
    topics = {topic: publisher(player, topic) for topic in (SCAN_INFO, NODE_STATE, *streams)}
    wanted = {DESIRED: 2, DRIVE: 2, ACHIEVED: 3}
    until(
        player,
        lambda: all(topics[t].get_subscription_count() == n for t, n in wanted.items()),
    )
    topics[SCAN_INFO].publish(info_message(info))
    for first in range(0, done.desired.x.size, BLOCK):
        for topic, stream in streams.items():
            stop = min(end(stream), first + BLOCK)
            block = part(stream, first, stop)
            last = stop == end(stream)
            topics[topic].publish(block_message(topic.kind, info, block, last=last))
        for name in READERS if states else ():
            state = state_message(info, name, RUNNING, abs(PAUSE_AT - first), "")
            topics[NODE_STATE].publish(state)
        if first == PAUSE_AT:
            time.sleep(PAUSE)
    until(player, lambda: len(lines) == SPEC.lines)
    ended = {name: node.process.wait(PATIENCE) for name, node in readers.items()}
    assert ended == dict.fromkeys(READERS, 0), {n: r.last_words() for n, r in readers.items()}


@pytest.mark.parametrize("announced", [True, False])
def test_blocks_wait_for_the_announcement_of_their_scan(
    player: ros.Node, *, announced: bool
) -> None:
    monitor = TrackingMonitor()
    info = info_of_scan(SPEC, "played", 10**18)
    topics = {topic: publisher(player, topic) for topic in (SCAN_INFO, DESIRED, ACHIEVED)}
    until(monitor, lambda: all(monitor.count_publishers(name) for name in monitor.inputs))
    for topic in (DESIRED, ACHIEVED):
        still = Trace(0, SPEC.sample_period, np.zeros(BLOCK), np.zeros(BLOCK))
        topics[topic].publish(block_message(topic.kind, info, still, last=False))
    until(monitor, lambda: monitor.calls == 2)
    monitor.step()
    if announced:
        topics[SCAN_INFO].publish(info_message(info))
        until(monitor, lambda: monitor.next_sample == BLOCK)
    else:
        time.sleep(monitor.settings["liveness_timeout_s"])
        with pytest.raises(ScanError, match="a block came before scan_info"):
            monitor.step()
    monitor.destroy_node()


def test_the_source_of_a_scan_is_missed_where_it_is_there(player: ros.Node) -> None:
    """``player`` joins the domain."""
    monitor = TrackingMonitor()
    monitor.begin(INFO)
    late = time.monotonic() + PATIENCE
    monitor.watch(late)
    assert player.get_node_names()
    source = ros.Node("source")
    publisher(source, SCAN_INFO)
    until(player, lambda: "source" in player.get_node_names())
    with pytest.raises(ScanError, match=r"^source has been silent for 0\.8 s$"):
        monitor.watch(late)
    source.destroy_node()
    until(player, lambda: "source" not in player.get_node_names())
    with pytest.raises(ScanError, match=r"^source has been silent for 0\.8 s$"):
        monitor.watch(late)
    monitor.destroy_node()
