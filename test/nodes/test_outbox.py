"""What DDS refuses to take is sent later, in its place."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy._rclpy_pybind11 import RCLError

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.nodes.messages import AFTERLIFE, Outbox


class Moody:
    """A publisher that takes a message or refuses it, by turns that are given."""

    topic_name = "/blocks"

    def __init__(self, moods: Iterator[bool]) -> None:
        self.taken: list[int] = []
        self._moods = moods

    def publish(self, message: int) -> None:
        if not next(self._moods, True):
            raise RCLError("cannot publish data")
        self.taken.append(message)


@given(moods=st.lists(st.booleans(), max_size=30), count=st.integers(0, 10))
def test_each_message_is_sent_once_and_in_order(moods: list[bool], count: int) -> None:
    publisher = Moody(iter(moods))
    outbox = Outbox(publisher)
    for message in range(count):
        outbox.send(message, now=0.0)
        assert publisher.taken == list(range(len(publisher.taken)))
    while not outbox.flush(now=0.0):
        assert len(publisher.taken) < count
    assert publisher.taken == list(range(count))


def test_one_that_refuses_for_longer_than_a_reader_counts_is_named() -> None:
    outbox = Outbox(Moody(iter([False] * 10)))
    outbox.send(1, now=100.0)
    assert not outbox.flush(now=100.0 + AFTERLIFE)
    with pytest.raises(ScanError, match=r"^/blocks cannot be published for 22 s: cannot publish"):
        outbox.flush(now=100.1 + AFTERLIFE)


def test_the_time_counts_from_the_last_message_that_was_taken() -> None:
    outbox = Outbox(Moody(iter([False, True, False, True])))
    outbox.send(1, now=0.0)
    outbox.send(2, now=20.0)
    assert outbox.flush(now=40.0)
