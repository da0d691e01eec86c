"""A node hears all that has arrived before it takes another for silent."""

import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import pytest

from afm_scan_ros import ros
from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.nodes.messages import state_message
from afm_scan_ros.nodes.run import live
from afm_scan_ros.nodes.scan_recorder import ScanRecorder

INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=("source", "other"))
RATE = 3000
"""States that arrive in a second."""
EVERY = 300
"""Of so many one is of the source: ten in a second, as nodes report."""
WORK = 0.01
"""Seconds of work of the node between two looks at its messages: too much for one at a time."""
DURATION = 4.0


class Busy(ScanRecorder):
    """Always has work."""

    def step(self) -> bool:
        time.sleep(WORK)
        return super().step() or True


class Arrivals:
    """In place of an executor: states that arrive at a steady rate, whoever has the time."""

    def __init__(self, node: ScanRecorder, caught: list[str], *, alive: bool = True) -> None:
        self._caught, self._alive = caught, alive
        self._began, self._arrived = time.monotonic(), 0
        self._waiting: deque[ros.Message] = deque()
        self._hear = {each.topic_name: each for each in node.subscriptions}
        node.begin(INFO)

    def spin_once(self, timeout_sec: float) -> None:
        """Hear one state."""
        elapsed = time.monotonic() - self._began
        while self._arrived < RATE * elapsed:
            name = "other" if self._arrived % EVERY or not self._alive else "source"
            self._waiting.append(state_message(INFO, name, "running", 0, ""))
            self._arrived += 1
        if elapsed > DURATION and not self._caught:
            self._caught.append("SIGTERM")
        if self._waiting:
            self._hear["/node_state"].callback(self._waiting.popleft())
        else:
            time.sleep(timeout_sec)


@pytest.fixture
def node(tmp_path: Path) -> Iterator[Busy]:
    words = ["--ros-args", "-p", f"bag:={tmp_path / 'bag'}"]
    ros.init(args=words, signal_handler_options=ros.SignalHandlerOptions.NO)
    made = Busy()
    yield made
    made.destroy_node()
    ros.shutdown()


def test_a_node_whose_states_are_there_is_not_silent(
    node: Busy, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(node, "watched", lambda: ("source",))
    monkeypatch.setattr(node, "_late", lambda _: None)
    node.hear_others()
    caught: list[str] = []
    arrivals = Arrivals(node, caught)
    monkeypatch.setattr(node, "hear_others", lambda: None)
    live(node, arrivals, caught)
    assert node.reason.startswith("interrupted by SIGTERM")


def test_a_node_that_says_nothing_is_silent_though_messages_never_end(
    node: Busy, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(node, "watched", lambda: ("source",))
    monkeypatch.setattr(node, "_late", lambda _: None)
    monkeypatch.setattr(node, "all_heard", lambda: None)
    node.hear_others()
    caught: list[str] = []
    arrivals = Arrivals(node, caught, alive=False)
    monkeypatch.setattr(node, "hear_others", lambda: None)
    live(node, arrivals, caught)
    assert node.reason == "source has been silent for 0.8 s"
