"""Many messages read at once are those that rosbags reads one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.bag.scan_info import DISPLACEMENT, BlockDecoder, decode_block, encode_block
from afm_scan_ros.bag.typestore import decode, layout_of
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace

PERIOD = 1e-5


def cdrs(scan_id: str, size: int, firsts: list[int], lasts: list[bool]) -> np.ndarray:
    """Return messages of so many samples each, as the rows of a chunk."""
    info = ScanInfo(scan_id, 0, "raster", PERIOD, 10**6)
    rows = []
    for first, last in zip(firsts, lasts, strict=True):
        x = np.arange(first, first + size, dtype=np.float64)
        cdr = encode_block(DISPLACEMENT, info, Trace(first, PERIOD, x, -x), last=last)
        rows.append(np.frombuffer(cdr, np.uint8))
    return np.stack(rows)


@settings(deadline=None, max_examples=20)
@given(
    scan_id=st.text(max_size=9),
    size=st.integers(1, 20),
    count=st.integers(1, 5),
    last=st.booleans(),
)
def test_blocks_that_follow_each_other_are_one(
    scan_id: str, size: int, count: int, *, last: bool
) -> None:
    rows = cdrs(scan_id, size, [7 + k * size for k in range(count)], [False] * (count - 1) + [last])
    each = [decode_block(DISPLACEMENT, row.tobytes()) for row in rows]
    found = BlockDecoder(DISPLACEMENT).together(rows)
    assert found is not None
    assert (found.scan_id, found.last, found.trace.first_sample) == (scan_id, last, 7)
    assert found.trace.x.tolist() == np.concatenate([b.trace.x for b in each]).tolist()
    assert found.trace.y.tolist() == np.concatenate([b.trace.y for b in each]).tolist()
    assert found.trace.x.flags.aligned


@pytest.mark.parametrize(
    ("firsts", "lasts"),
    [([0, 9], [False, False]), ([4, 0], [False, False]), ([0, 4], [True, False])],
    ids=["a gap", "a repeat", "an end before the end"],
)
def test_blocks_that_do_not_follow_are_looked_at_one_by_one(
    firsts: list[int], lasts: list[bool]
) -> None:
    assert BlockDecoder(DISPLACEMENT).together(cdrs("scan", 4, firsts, lasts)) is None


def test_a_byte_that_shapes_a_message_is_never_passed_over() -> None:
    """Each byte turned over in the last of three changes what is read, or they are not one."""
    rows = cdrs("scan", 2, [0, 2, 4], [False, False, True])
    decoder = BlockDecoder(DISPLACEMENT)
    before = decoder.together(rows)
    layout = layout_of(DISPLACEMENT, rows[0])
    assert before is not None
    for place in layout.shaping:
        turned = rows.copy()
        turned[2, place] ^= 0xFF
        assert decoder.together(turned) is None


def test_every_field_lies_where_rosbags_finds_it() -> None:
    (row,) = rows = cdrs("a scan", 3, [5], [True])
    message, table = decode(DISPLACEMENT, row.tobytes()), layout_of(DISPLACEMENT, row).table(rows)
    assert table is not None
    (found,) = table
    assert found["header.stamp.nanosec"] == message.header.stamp.nanosec
    assert found["header.frame_id"].tobytes().decode() == message.header.frame_id
    assert found["first_sample"] == message.first_sample
    assert found["x"].tolist() == message.x.tolist()
    assert found["last"] == message.last
