"""What is written is read back, by this package and by others' readers."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import (
    DISPLACEMENT,
    STREAMS,
    decode_block,
    decode_info,
    encode_block,
    encode_info,
)
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.bag.writer import BagWriter, ScanWriter
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace

START = 1_700_000_000_000_000_123


def spec() -> ScanSpec:
    return ScanSpec(lines=2, samples_per_line=400, line_rate=50.0, preparation="none")


def streams(info: ScanInfo, seed: int = 1) -> dict[str, Trace]:
    rng = np.random.default_rng(seed)
    n, period = info.total_samples, info.sample_period
    return {name: Trace(0, period, *rng.normal(size=(2, n))) for name in STREAMS}


def cut(trace: Trace, size: int) -> list[Trace]:
    return [
        Trace(k, trace.sample_period, trace.x[k : k + size], trace.y[k : k + size])
        for k in range(0, trace.x.size, size)
    ]


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    info = info_of_scan(spec(), "scan-1", START)
    with ScanWriter(tmp_path / "bag", info) as writer:
        for index, (name, trace) in enumerate(streams(info).items()):
            for block in cut(trace, 300 + 77 * index):
                writer.add(name, block)
    return tmp_path / "bag"


def test_a_scan_reads_back_identical(bag: Path) -> None:
    recording = read_scan(bag)
    assert recording.info == info_of_scan(spec(), "scan-1", START)
    assert recording.warnings == ()
    for name, trace in streams(recording.info).items():
        assert np.array_equal(recording.whole(name).x, trace.x)
        assert np.array_equal(recording.whole(name).y, trace.y)


def test_streams_cut_differently_come_aligned(bag: Path) -> None:
    recording = read_scan(bag)
    position = 0
    for desired, achieved in recording.blocks("desired_displacement", "achieved_displacement"):
        assert desired.first_sample == achieved.first_sample == position
        assert desired.x.size == achieved.x.size
        position += desired.x.size
    assert position == recording.info.total_samples


def test_a_single_file_reads_as_its_folder_does(bag: Path) -> None:
    whole, single = read_scan(bag), read_scan(bag / "bag_0.mcap")
    assert np.array_equal(whole.whole("drive_voltage").y, single.whole("drive_voltage").y)


def test_a_namespace_does_not_matter(tmp_path: Path) -> None:
    info = info_of_scan(spec(), "scan-1", START)
    trace = streams(info)["desired_displacement"]
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/left/scan_info", SCAN_INFO, latched=True)
        writer.add_topic("/left/desired_displacement", DISPLACEMENT)
        writer.write("/left/scan_info", START, encode_info(info))
        block = encode_block(DISPLACEMENT, info, trace, last=True)
        writer.write("/left/desired_displacement", START, block)
    recording = read_scan(tmp_path / "bag")
    assert recording.topics == {"desired_displacement": "/left/desired_displacement"}
    assert np.array_equal(recording.whole("desired_displacement").x, trace.x)


@given(
    values=st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=50),
    first=st.integers(0, 2**62),
    scan_id=st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=30),
    last=st.booleans(),
)
@settings(deadline=None)
def test_any_block_survives_its_message(
    *, values: list[float], first: int, scan_id: str, last: bool
) -> None:
    x = np.array(values, dtype=np.float64)
    info = ScanInfo(scan_id, 0, "raster", 1e-12, 1)
    block = decode_block(
        DISPLACEMENT, encode_block(DISPLACEMENT, info, Trace(first, 1e-12, x, -x), last=last)
    )
    assert np.array_equal(block.trace.x, x)
    assert np.array_equal(block.trace.y, -x)
    assert (block.trace.first_sample, block.scan_id, block.last) == (first, scan_id, last)


@pytest.mark.parametrize("with_spec", [True, False])
def test_scan_info_survives_its_message(*, with_spec: bool) -> None:
    info = evolve(
        info_of_scan(spec(), "s", START),
        inverses=("creep", "vibration"),
        model_hash="ab" * 32,
        trigger_offset=1e-6,
        window=20_000,
        nodes=("piezoscanner_sim",),
    )
    if not with_spec:
        info = evolve(info, spec=None, pattern="hysteresis")
    assert decode_info(encode_info(info)) == info


def test_rosbags_reads_it(bag: Path) -> None:
    with Reader(bag) as reader:
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    assert qos["/scan_info"].durability.name == "TRANSIENT_LOCAL"
    assert qos["/drive_voltage"].history.name == "KEEP_ALL"
    with AnyReader([bag]) as reader:
        found = [
            reader.deserialize(raw, connection.msgtype).x
            for connection, _, raw in reader.messages()
            if connection.topic == "/true_displacement"
        ]
        assert reader.message_count == sum(c.msgcount for c in reader.connections)
    expected = streams(info_of_scan(spec(), "scan-1", START))["true_displacement"].x
    assert np.array_equal(np.concatenate(found), expected)


def test_mcap_reads_it(bag: Path) -> None:
    with (bag / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        times = [message.log_time for _, _, message in reader.iter_messages()]
    assert summary is not None
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert min(times) == START
    assert all(len(c.metadata["topic_type_hash"]) == 7 + 64 for c in summary.channels.values())


def test_metadata_counts_what_is_there(bag: Path) -> None:
    text = (bag / "metadata.yaml").read_text()
    about = yaml.safe_load(text)["rosbag2_bagfile_information"]
    counts = {
        topic["topic_metadata"]["name"]: topic["message_count"]
        for topic in about["topics_with_message_count"]
    }
    assert about["version"] == 9
    assert about["message_count"] == sum(counts.values())
    assert counts["/scan_info"] == 1
    assert about["starting_time"]["nanoseconds_since_epoch"] == START
