"""Every sample once, in order, and a number: a guard takes that and refuses all else by name."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.bag.typestore import encode
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.streams import MAX_BLOCK
from afm_scan_ros.nodes.messages import NOT_TOLD, BlockGuard

TOTAL = 60
PERIOD = 1e-4
TYPE = "afm_scan_ros/msg/VoltageBlock"


def block(first: int, count: int, **other: object) -> bytes:
    samples = np.arange(first, first + count, dtype=np.float64)
    fields = {"scan_id": "s", "sample_period": PERIOD, "x": samples, "y": -samples, "last": False}
    return encode(TYPE, 0, {"first_sample": first, **fields, **other})


def guard(total: int = TOTAL) -> BlockGuard:
    return BlockGuard("drive_voltage", TYPE, "s", PERIOD, total)


cuts = st.sets(st.integers(1, TOTAL - 1)).map(lambda inner: [0, *sorted(inner), TOTAL])


@given(cuts, st.integers(0, 2**63))
def test_any_cut_of_a_scan_comes_back_whole(edges: list[int], first: int) -> None:
    watched = guard()
    blocks = [block(a, b - a, last=b == TOTAL) for a, b in pairwise(edges)]
    parts = [watched.accept(each, first + index) for index, each in enumerate(blocks)]
    assert np.array_equal(np.concatenate([part.x for part in parts]), np.arange(TOTAL))
    assert [part.first_sample for part in parts] == edges[:-1]
    assert watched.complete
    assert watched.next_sample == TOTAL


def accept(watched: BlockGuard, blocks: Iterable[bytes]) -> None:
    for one in blocks:
        watched.accept(one, NOT_TOLD)


@given(cuts.filter(lambda edges: len(edges) > 2), st.data())
def test_a_lost_block_is_missed_by_the_next(edges: list[int], data: st.DataObject) -> None:
    blocks = [block(a, b - a) for a, b in pairwise(edges)]
    at = data.draw(st.integers(0, len(blocks) - 2))
    watched = guard()
    missing = f"drive_voltage: samples {edges[at]} to {edges[at + 1] - 1} are missing"
    with pytest.raises(ScanError, match=missing):
        accept(watched, blocks[:at] + blocks[at + 1 :])
    assert watched.next_sample == edges[at]


@given(cuts, st.data())
def test_a_repeated_block_is_refused(edges: list[int], data: st.DataObject) -> None:
    blocks = [block(a, b - a) for a, b in pairwise(edges)]
    at = data.draw(st.integers(0, len(blocks) - 1))
    watched = guard()
    repeated = f"drive_voltage: sample {edges[at]} came again, where {edges[at + 1]} was due"
    with pytest.raises(ScanError, match=repeated):
        accept(watched, blocks[: at + 1] + blocks[at:])
    assert watched.next_sample == edges[at + 1]


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"sample_period": 2e-4}, "sample period changed from 0.0001 s to 0.0002 s at sample 10"),
        ({"scan_id": "older"}, "a block of scan 'older' came during scan 's'"),
        ({"y": np.zeros(4)}, "sample 10: 5 x values but 4 y values"),
        ({"x": np.empty(0), "y": np.empty(0)}, "sample 10: 0 samples, not 1 to"),
        ({"x": np.zeros(MAX_BLOCK + 1), "y": np.zeros(MAX_BLOCK + 1)}, "10001 samples"),
        ({"x": np.array([0, 0, np.nan, 0, 0])}, "sample 12, x: nan is not a finite number"),
        ({"y": np.array([0, 0, 0, -np.inf, 0])}, "sample 13, y: -inf is not a finite number"),
    ],
)
def test_what_is_wrong_is_named(wrong: dict[str, object], named: str) -> None:
    watched = guard()
    watched.accept(block(0, 10), 1)
    with pytest.raises(ScanError, match=named):
        watched.accept(block(10, 5, **wrong), 2)
    assert watched.next_sample == 10


def test_numbers_are_taken_however_large() -> None:
    taken = guard().accept(block(0, 3, x=np.array([1e308, -1e308, 1e308]), y=np.full(3, 1e308)), 1)
    assert list(taken.x) == [1e308, -1e308, 1e308]


def test_nothing_follows_the_last_block() -> None:
    watched = guard()
    watched.accept(block(0, 10, last=True), 1)
    with pytest.raises(ScanError, match="a block at sample 10 came after the scan's last block"):
        watched.accept(block(10, 5), 2)


def test_nothing_lies_beyond_the_scan() -> None:
    with pytest.raises(ScanError, match="sample 60 is beyond the 60 of the scan"):
        guard().accept(block(0, TOTAL + 1), 1)


@given(st.integers(0, 2**63), st.integers(-5, 5).filter(lambda step: step != 1))
def test_a_block_of_another_publisher_is_refused_whatever_it_holds(number: int, step: int) -> None:
    """Each publisher numbers its messages; the forged block below is the very one that is due."""
    watched = guard()
    watched.accept(block(0, 10), number)
    with pytest.raises(ScanError, match="the block at sample 10 is of another publisher"):
        watched.accept(block(10, 5), number + step)
    assert watched.next_sample == 10
