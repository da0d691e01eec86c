"""A node hears all that has arrived before it takes another for silent."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import pytest

from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.nodes.messages import Message, state_message
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.run import live
from afm_scan_ros.nodes.scan_recorder import ScanRecorder
from afm_scan_ros.nodes.topics import NODE_STATE
from helpers.ros import joined

NODES = ("source", "other", "one that is never heard")
INFO = ScanInfo("tested", 10**18, "creep", 1e-4, 4000, window=4000, nodes=NODES)
RATE = 3000
"""States that arrive in a second."""
EVERY = 300
"""Of so many one is of the source: ten in a second, as nodes report."""
WORK = 0.01
"""Seconds of work of the node between two looks at its messages: too much for one at a time."""
DURATION = 4.0


class Busy(ScanRecorder):
    """Always has work, and waits for the source alone."""

    def step(self) -> bool:
        time.sleep(WORK)
        return super().step() or True

    def watched(self) -> tuple[str, ...]:
        return ("source",)


class Arrivals:
    """Subscription, its handle and executor in one: states arrive at a steady rate."""

    msg_type, raw = NODE_STATE.kind, False

    def __init__(self, caught: list[str], dies_at: float) -> None:
        self._caught, self._dies_at = caught, dies_at
        self._began, self._taken = time.monotonic(), 0
        self.handle = self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def take_message(self, *_: object) -> tuple[Message, dict[str, int]] | None:
        """Return the next state, if it has arrived."""
        arrived = self._taken / RATE
        if arrived > time.monotonic() - self._began:
            return None
        self._taken += 1
        of_source = not self._taken % EVERY and arrived < self._dies_at
        name = "source" if of_source else "other"
        message = state_message(INFO, name, "running", 0, "")
        return message, {"publication_sequence_number": self._taken}

    def spin_once(self, timeout_sec: float) -> None:  # noqa: ARG002 - rclpy's
        """Serve nothing; end the test where nothing else has."""
        if self._taken / RATE > DURATION and not self._caught:
            self._caught.append("SIGTERM")


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Busy]:
    with joined(bag=str(tmp_path / "bag"), real_time=False):
        made = Busy()
        made.hear_others()
        made.begin(INFO)
        made.go(RUNNING)
        monkeypatch.setattr(made, "hear_others", lambda: None)
        yield made
        made.destroy_node()


def let_live(node: Busy, monkeypatch: pytest.MonkeyPatch, dies_at: float) -> str:
    """Return why a node ended to which states arrive."""
    caught: list[str] = []
    arrivals = Arrivals(caught, dies_at)
    (hear,) = (each for topic, each in node._readers if topic.topic_name == "/node_state")  # noqa: SLF001 - in whose place others arrive
    monkeypatch.setattr(node, "_readers", [(arrivals, hear)])
    monkeypatch.setattr(node, "await_message", time.sleep)
    live(node, arrivals, caught)
    return node.reason


def test_a_node_whose_states_are_there_is_not_silent(
    node: Busy, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert let_live(node, monkeypatch, 2.0 * DURATION).startswith("interrupted by SIGTERM")


def test_a_node_that_says_nothing_is_silent_though_messages_never_end(
    node: Busy, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(node, "all_heard", lambda: None)
    assert let_live(node, monkeypatch, 1.0) == "source has been silent for 0.8 s"
