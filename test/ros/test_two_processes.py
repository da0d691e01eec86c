"""Two real processes over DDS on the loopback, in their own domain."""

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from afm_scan_ros import ros
from afm_scan_ros.ros.cyclone import HOLDS_LOCK

KEEP_ALL = ros.QoSProfile(history=ros.HistoryPolicy.KEEP_ALL)
LATCHED = ros.QoSProfile(depth=10, durability=ros.DurabilityPolicy.TRANSIENT_LOCAL)
SAMPLES = 1000

Start = Callable[..., subprocess.Popen[str]]
Spin = Callable[[Callable[[], bool]], None]


def test_a_block_arrives_as_it_was_sent(node: ros.Node, start: Start, spin_until: Spin) -> None:
    blocks: list[ros.Message] = []
    node.create_subscription(ros.DisplacementBlock, "blocks", blocks.append, KEEP_ALL)
    start("publish", "3")
    spin_until(lambda: len(blocks) == 3)
    expected = np.arange(3.0 * SAMPLES)
    assert np.array_equal(np.concatenate([block.x for block in blocks]), expected)
    assert np.array_equal(np.concatenate([np.frombuffer(b.y) for b in blocks]), -expected)
    assert {block.scan_id for block in blocks} == {"ramp"}


def test_raw_gives_the_bytes_of_the_message(node: ros.Node, start: Start, spin_until: Spin) -> None:
    received: list[bytes] = []
    node.create_subscription(ros.DisplacementBlock, "blocks", received.append, KEEP_ALL, raw=True)
    start("publish", "1")
    spin_until(lambda: bool(received))
    block = ros.deserialize_message(received[0], ros.DisplacementBlock)
    assert np.array_equal(block.x, np.arange(1.0 * SAMPLES))


def test_keep_all_loses_nothing_though_the_reader_is_slow(
    node: ros.Node, start: Start, spin_until: Spin
) -> None:
    first_samples: list[int] = []

    def slowly(block: ros.Message) -> None:
        time.sleep(0.0005)
        first_samples.append(block.first_sample)

    node.create_subscription(ros.DisplacementBlock, "blocks", slowly, KEEP_ALL)
    start("publish", "2000")
    spin_until(lambda: len(first_samples) == 2000)
    assert first_samples == [SAMPLES * index for index in range(2000)]


def test_a_late_reader_gets_what_was_latched(
    node: ros.Node, start: Start, spin_until: Spin
) -> None:
    peer = start("latch", "5")
    assert peer.stdout is not None
    assert peer.stdout.readline() == "latched\n"
    states: list[ros.Message] = []
    node.create_subscription(ros.NodeState, "state", states.append, LATCHED)
    spin_until(lambda: len(states) == 3)  # the writer's depth
    assert [state.next_sample for state in states] == [2, 3, 4]
    assert {state.state for state in states} == {ros.NodeState.RUNNING}


def test_a_service_answers(node: ros.Node, start: Start, spin_until: Spin) -> None:
    client = node.create_client(ros.Trigger, "stop")
    start("serve")
    assert client.wait_for_service(timeout_sec=20.0)
    futures = [client.call_async(ros.Trigger.Request()) for _ in range(3)]
    spin_until(lambda: all(future.done() for future in futures))
    assert {future.result().message for future in futures} == {"ramped down"}


def test_publishers_are_counted_while_they_last(
    node: ros.Node, start: Start, spin_until: Spin
) -> None:
    assert node.count_publishers("blocks") == 0
    node.create_subscription(ros.DisplacementBlock, "blocks", lambda _: None, KEEP_ALL)
    peer = start("advertise")
    spin_until(lambda: node.count_publishers("blocks") == 1)
    peer.communicate("end\n")
    spin_until(lambda: node.count_publishers("blocks") == 0)
    assert node.count_subscribers("blocks") == 1


def test_other_threads_run_while_publish_waits_for_a_reader(
    node: ros.Node, start: Start, spin_until: Spin
) -> None:
    """Only the other thread wakes the reader that ``publish`` waits for."""
    publisher = node.create_publisher(ros.DisplacementBlock, "blocks", KEEP_ALL)
    peer = start("read")
    spin_until(lambda: publisher.get_subscription_count() == 1)
    published = [0]
    woken = threading.Event()

    def wake_when_stuck() -> None:
        seen = -1
        while published[0] != seen:
            seen = published[0]
            time.sleep(0.5)
        os.kill(peer.pid, signal.SIGCONT)
        woken.set()

    os.kill(peer.pid, signal.SIGSTOP)
    watchdog = threading.Thread(target=wake_when_stuck)
    watchdog.start()
    block = ros.DisplacementBlock(x=np.zeros(SAMPLES), y=np.zeros(SAMPLES))
    while not woken.is_set() and published[0] < 100_000:
        publisher.publish(block)
        published[0] += 1
    assert woken.is_set()
    watchdog.join()


def test_a_publish_that_blocks_can_hold_the_interpreter_as_rclpy_s_does(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ends when the reader's lease is over."""
    monkeypatch.setenv(HOLDS_LOCK, "1")
    reader, writer = start("read"), start("flood")
    assert writer.stdout is not None
    assert writer.stdout.readline() == "begins\n"
    reader.send_signal(signal.SIGSTOP)
    assert int(writer.stdout.readline()) <= 1


def test_counting_takes_a_name_as_it_is_after_remapping() -> None:
    rules = ["-r", "a:=b", "-r", "b:=c"]
    ros.init(args=["--ros-args", *rules], signal_handler_options=ros.SignalHandlerOptions.NO)
    try:
        node = ros.Node("tested")
        publisher = node.create_publisher(ros.NodeState, "a", 1)
        assert publisher.topic_name == "/b"
        assert [node.count_publishers(name) for name in ("/a", "/b", "/c")] == [0, 1, 0]
    finally:
        ros.shutdown()


def test_incompatible_quality_of_service_is_said(
    node: ros.Node, spin_until: Spin, capfd: pytest.CaptureFixture[str]
) -> None:
    said = ""

    def both_said() -> bool:
        nonlocal said
        said += capfd.readouterr().err
        return "requesting incompatible" in said and "offering incompatible" in said

    publisher = node.create_publisher(ros.NodeState, "state", ros.QoSProfile(depth=1))
    node.create_subscription(ros.NodeState, "state", lambda _: None, LATCHED)
    spin_until(both_said)
    assert "'state'" in said
    assert "DURABILITY" in said
    assert publisher.get_subscription_count() == 0
