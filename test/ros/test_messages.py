"""Messages of the stand-in against bytes and hashes that ROS 2 itself wrote."""

import array
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.reader import NonSeekingReader

from afm_scan_ros import ros
from afm_scan_ros.ros.cyclone.message_types import message_class, type_hash

ROOT = Path(__file__).parents[2]
FOREIGN = Path(os.environ.get("AFM_SCAN_DATA", ROOT / "../shared/data")) / "rosbag2"
needs_bags = pytest.mark.skipif(
    not FOREIGN.is_dir(), reason=f"no foreign bags at {FOREIGN}: AFM_SCAN_DATA"
)


@needs_bags
@pytest.mark.parametrize("bag", ["only_topics.mcap", "wbag/wbag_0.mcap"])
def test_cdr_is_that_of_ros(bag: str) -> None:
    with (FOREIGN / bag).open("rb") as stream:
        found = list(NonSeekingReader(stream).iter_messages(log_time_order=False))
    assert found
    for schema, _, record in found:
        message = ros.deserialize_message(record.data, message_class(schema.name))
        assert ros.serialize_message(message) == record.data


@needs_bags
def test_type_hashes_are_those_of_ros() -> None:
    with (FOREIGN / "only_topics.mcap").open("rb") as stream:
        found = NonSeekingReader(stream).iter_messages(log_time_order=False)
        hashes = {s.name: c.metadata["topic_type_hash"] for s, c, _ in found}
    assert hashes
    for name, expected in hashes.items():
        assert type_hash(message_class(name)) == expected


def test_header_hash_is_that_of_jazzy() -> None:
    """As ``ros2 topic info -v`` of Jazzy prints it for std_msgs/msg/Header."""
    expected = "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"
    assert type_hash(ros.Header) == expected


@settings(deadline=None)
@given(
    x=arrays(np.float64, st.integers(0, 20)),
    first=st.integers(0, 2**64 - 1),
    scan_id=st.text(),
    last=st.booleans(),
)
def test_what_is_written_is_read(x: np.ndarray, first: int, scan_id: str, *, last: bool) -> None:
    block = ros.VoltageBlock(first_sample=first, scan_id=scan_id, x=x, last=last)
    back = ros.deserialize_message(ros.serialize_message(block), ros.VoltageBlock)
    assert np.array_equal(back.x, x, equal_nan=True)
    assert (back.first_sample, back.scan_id, back.last) == (first, scan_id, last)
    assert back.y.size == 0


def test_received_samples_suit_compiled_loops() -> None:
    block = ros.VoltageBlock(x=np.arange(5.0))
    back = ros.deserialize_message(ros.serialize_message(block), ros.VoltageBlock)
    assert back.x.flags.aligned
    assert back.x.flags.writeable


def test_an_array_is_taken_without_a_copy() -> None:
    samples = array.array("d", [1.0, 2.0])
    block = ros.VoltageBlock()
    block.x = samples
    assert np.shares_memory(block.x, np.frombuffer(samples))


@pytest.mark.parametrize(
    ("field", "value"), [("first_sample", 1.0), ("sample_period", 1), ("scan_id", 7), ("header", 0)]
)
def test_a_value_of_the_wrong_type_is_refused(field: str, value: object) -> None:
    with pytest.raises(TypeError, match=field):
        setattr(ros.DisplacementBlock(), field, value)


def test_a_field_that_the_definition_lacks_is_refused() -> None:
    with pytest.raises(AttributeError):
        ros.NodeState().stat = "ready"
    with pytest.raises(TypeError):
        ros.NodeState(stat="ready")


def test_constants_are_those_of_the_definition() -> None:
    assert (ros.NodeState.READY, ros.NodeState.FAILED) == ("ready", "failed")


def test_each_message_has_fields_of_its_own() -> None:
    one, other = ros.VoltageBlock(), ros.VoltageBlock()
    one.header.frame_id = "scanner"
    assert other.header.frame_id == ""
