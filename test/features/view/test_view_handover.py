"""The handover of blocks: the scan never waits, the oldest go first, and what has gone is told."""

import socket
import time
from threading import Thread

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.drivers.link import Link, Message
from afm_scan_ros.features.view.handover import BLOCK, ENDED, LEFT_OUT, SAY, Handover
from afm_scan_ros.features.view.viewer import ViewSettings

SAMPLES = 20_000
"""In a block: more than a socket takes while nobody reads."""
ROOM = 10
"""Blocks that may wait."""
SETTINGS = ViewSettings(queue=ROOM * 16.0 * SAMPLES, queued_news=5)


def block(number: int) -> Message:
    return Message(BLOCK, {"number": number}, np.full((2, SAMPLES), float(number)))


def read_slowly(end: socket.socket, pause: float, found: list[Message]) -> None:
    link = Link(end)
    link.patience = 10.0
    try:
        while True:
            found.append(link.receive())
            time.sleep(pause)
    except EOFError:
        return


@given(st.integers(0, 60), st.sampled_from([0.0, 1e-3, 5e-3]))
@settings(max_examples=30, deadline=None)
def test_what_comes_and_what_is_told_as_left_out_is_all(count: int, pause: float) -> None:
    ours, theirs = socket.socketpair()
    messages: list[Message] = []
    with ours, theirs:
        reader = Thread(target=read_slowly, args=(theirs, pause, messages))
        reader.start()
        handover = Handover(ours, SETTINGS)
        for number in range(count):
            handover.block(block(number))
        handover.finish()
        reader.join()
    numbers = [each.fields["number"] for each in messages if each.kind == BLOCK]
    lost = sum(each.fields["count"] for each in messages if each.kind == LEFT_OUT)
    assert numbers == sorted(numbers)
    assert len(numbers) + lost == count
    for each in messages:
        if each.kind == BLOCK:
            assert (each.samples == each.fields["number"]).all()


def test_the_oldest_go_and_are_counted_while_nobody_reads() -> None:
    ours, theirs = socket.socketpair()
    count = 5 * ROOM
    with ours, theirs:
        handover = Handover(ours, SETTINGS)
        for number in range(count):
            began = time.monotonic()
            handover.block(block(number))
            assert time.monotonic() - began < 0.1
        link = Link(theirs)
        link.patience = 10.0
        messages = []
        while not messages or messages[-1].fields.get("number") != count - 1:
            messages.append(link.receive())
        handover.close()
    numbers = [each.fields["number"] for each in messages if each.kind == BLOCK]
    lost = sum(each.fields["count"] for each in messages if each.kind == LEFT_OUT)
    assert numbers[-ROOM:] == list(range(count - ROOM, count))
    assert lost == count - len(numbers) > count - 2 * ROOM


def test_news_are_bounded_too_and_come_beside_blocks_that_wait() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        handover = Handover(ours, SETTINGS)
        for number in range(ROOM):
            handover.block(block(number))
        for number in range(20):
            handover.news(Message(SAY, {"text": str(number)}))
        link = Link(theirs)
        link.patience = 10.0
        messages = [link.receive() for _ in range(ROOM)]
        handover.close()
    texts = [each.fields["text"] for each in messages if each.kind == SAY]
    assert texts == [str(number) for number in range(15, 20)]
    assert [each.fields["count"] for each in messages if each.kind == LEFT_OUT] == [15]


def test_a_process_that_is_gone_or_does_not_read_holds_up_nothing() -> None:
    for gone in (True, False):
        ours, theirs = socket.socketpair()
        with ours, theirs:
            if gone:
                theirs.close()
            handover = Handover(ours, SETTINGS)
            began = time.monotonic()
            for number in range(3 * ROOM):
                handover.block(block(number))
            handover.finish()
            handover.close()
            assert time.monotonic() - began < 2.0


def test_the_last_word_comes_after_blocks_that_wait() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        handover = Handover(ours, SETTINGS)
        handover.last = Message(ENDED)
        for number in range(ROOM // 2):
            handover.block(block(number))
        handover.finish()
        messages: list[Message] = []
        read_slowly(theirs, 0.0, messages)
    assert [each.kind for each in messages] == [BLOCK] * (ROOM // 2) + [ENDED]
