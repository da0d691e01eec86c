"""Bags that are cut, foreign, damaged or contradictory: one line that reports it, never silence."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import DISPLACEMENT, encode_block, encode_info
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.bag.writer import BagWriter, ScanWriter
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace

ROOT = Path(__file__).parents[2]
FOREIGN = Path(os.environ.get("AFM_SCAN_DATA", ROOT / "../shared/data")) / "rosbag2"

PERIOD = 1e-2
INFO = ScanInfo("scan-1", 0, "creep", PERIOD, 1000)
BLOCK = 50


def block(first: int, size: int = BLOCK) -> Trace:
    samples = np.arange(first, first + size, dtype=np.float64)
    return Trace(first, PERIOD, samples, -samples)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record ten seconds of scan, so that the file has about as many chunks."""
    folder = tmp_path_factory.mktemp("bags") / "bag"
    with ScanWriter(folder, INFO) as writer:
        for first in range(0, 1000, BLOCK):
            for name in ("desired_displacement", "achieved_displacement"):
                writer.add(name, block(first))
    return folder


@given(st.data())
@settings(
    deadline=None, max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_a_bag_cut_anywhere_reads_up_to_there(
    bag: Path, tmp_path: Path, data: st.DataObject
) -> None:
    content = (bag / "bag_0.mcap").read_bytes()
    length = data.draw(st.integers(0, len(content) - 1))
    path = tmp_path / "cut.mcap"
    path.write_bytes(content[:length])
    try:
        recording = read_scan(path)
    except InputError as error:
        message = str(error)
        assert "no messages at all; " in message
        assert "reindex" in message
        assert message.count(str(path)) == 2
        assert length < 10_000
        return
    assert "ros2 bag reindex" in recording.warnings[0]
    samples = recording.whole("achieved_displacement") if recording.topics else block(0, 0)
    assert np.array_equal(samples.x, np.arange(samples.x.size))
    # At most the chunk in progress is lost, a tenth; definitions and summary are not samples.
    assert samples.x.size / 1000 > length / len(content) - 0.3


def test_a_killed_recorder_leaves_what_it_had_finished(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic("/scan_info", SCAN_INFO, latched=True)
    writer.add_topic("/achieved_displacement", DISPLACEMENT)
    writer.write("/scan_info", 0, encode_info(INFO))
    for first in range(0, 500, BLOCK):
        cdr = encode_block(DISPLACEMENT, INFO, block(first), last=False)
        writer.write("/achieved_displacement", INFO.stamp(first), cdr)
    recording = read_scan(tmp_path / "bag")
    assert recording.whole("achieved_displacement").x.size >= 400
    assert "metadata.yaml" in recording.warnings[0]
    assert "cut short" in recording.warnings[1]
    writer.close()


Change = Callable[[list[tuple[ScanInfo, Trace]]], object]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda b: b.pop(3), "samples 150 to 199 are missing"),
        (lambda b: b.pop(0), "samples 0 to 49 are missing"),
        (lambda b: b.insert(3, b[2]), "sample 100 comes again"),
        (lambda b: b.__setitem__(2, (evolve(INFO, scan_id="other"), b[2][1])), "scan 'other'"),
        (lambda b: b.__setitem__(2, (INFO, evolve(b[2][1], sample_period=2e-2))), "0.02 s"),
        (lambda b: b[2][1].y.__setitem__(7, np.nan), "y is nan at sample 107"),
        (lambda b: b[1][1].x.__setitem__(0, np.inf), "x is inf at sample 50"),
        (lambda b: b.__setitem__(1, (INFO, evolve(b[1][1], y=np.zeros(3)))), "y 3"),
    ],
)
def test_a_faulty_stream_is_refused_by_name_and_sample(
    tmp_path: Path, change: Change, message: str
) -> None:
    blocks = [(INFO, block(first)) for first in range(0, 1000, BLOCK)]
    change(blocks)
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/scan_info", SCAN_INFO, latched=True)
        writer.add_topic("/desired_displacement", DISPLACEMENT)
        writer.write("/scan_info", 0, encode_info(INFO))
        for info, trace in blocks:
            cdr = encode_block(DISPLACEMENT, info, trace, last=False)
            writer.write("/desired_displacement", info.stamp(trace.first_sample), cdr)
    with pytest.raises(InputError, match=f"desired_displacement: .*{message}"):
        read_scan(tmp_path / "bag").whole("desired_displacement")


def test_two_scans_in_a_bag_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/scan_info", SCAN_INFO, latched=True)
        for scan_id in ("a", "b"):
            writer.write("/scan_info", 0, encode_info(evolve(INFO, scan_id=scan_id)))
    with pytest.raises(InputError, match="'a' and 'b'"):
        read_scan(tmp_path / "bag")


def test_two_scanners_in_a_bag_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        for name in ("/left/achieved_displacement", "/right/achieved_displacement"):
            writer.add_topic(name, DISPLACEMENT)
            writer.write(name, 0, encode_block(DISPLACEMENT, INFO, block(0), last=False))
    with pytest.raises(InputError, match=r"/left/.* and /right/"):
        read_scan(tmp_path / "bag")


def test_a_missing_stream_is_named(bag: Path) -> None:
    with pytest.raises(InputError, match="no drive_voltage"):
        read_scan(bag).whole("drive_voltage")


def test_of_a_file_that_was_cut_a_missing_stream_is_laid_to_that(bag: Path, tmp_path: Path) -> None:
    """It may well have been recorded: to record it too would be no mend."""
    path = tmp_path / "cut.mcap"
    path.write_bytes((bag / "bag_0.mcap").read_bytes()[:-1000])
    with pytest.raises(InputError, match=r"no drive_voltage: .* cut short: .* 'ros2 bag reindex"):
        read_scan(path).whole("drive_voltage")


def test_an_empty_bag_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag"):
        pass
    with pytest.raises(InputError, match="no messages at all"):
        read_scan(tmp_path / "bag")


def test_a_damaged_bag_is_refused(bag: Path, tmp_path: Path) -> None:
    content = bytearray((bag / "bag_0.mcap").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "damaged.mcap").write_bytes(content)
    with pytest.raises(InputError, match=r"damaged\.mcap is damaged"):
        read_scan(tmp_path / "damaged.mcap").whole("achieved_displacement")


def test_a_message_that_is_not_of_its_type_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/scan_info", SCAN_INFO, latched=True)
        writer.write("/scan_info", 0, encode_info(INFO)[:60])
    with pytest.raises(InputError, match=r"bag: scan_info: not a"):
        read_scan(tmp_path / "bag")


def test_a_stream_of_another_type_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/drive_voltage", DISPLACEMENT)
        writer.write("/drive_voltage", 0, encode_block(DISPLACEMENT, INFO, block(0), last=False))
    with pytest.raises(InputError, match="VoltageBlock"):
        read_scan(tmp_path / "bag")


def test_a_bag_is_never_overwritten(bag: Path) -> None:
    with pytest.raises(InputError, match="exists already"):
        BagWriter(bag)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "not a rosbag2 metadata"),
        ("a: [", "not a rosbag2 metadata"),
        ("rosbag2_bagfile_information: {relative_file_paths: [gone_0.mcap]}", "gone_0.mcap"),
        (
            "rosbag2_bagfile_information: {storage_identifier: sqlite3, relative_file_paths: []}",
            "sqlite3",
        ),
    ],
)
def test_a_wrong_metadata_file_is_refused(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "metadata.yaml").write_text(content)
    with pytest.raises(InputError, match=message):
        read_scan(tmp_path)


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_scan(tmp_path / "gone")
    with pytest.raises(InputError, match="neither"):
        read_scan(tmp_path)
    (tmp_path / "text.mcap").write_text("not an mcap file")
    with pytest.raises(InputError, match="not an MCAP"):
        read_scan(tmp_path / "text.mcap")


def test_split_files_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number, first in enumerate(range(0, 1000, BLOCK)):
        _write_part(tmp_path / f"part_{number}.mcap", first)
    recording = read_scan(tmp_path)
    assert recording.whole("desired_displacement").x.size == 1000


def _write_part(path: Path, first: int) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for topic, type_name, cdr in (
            ("/scan_info", SCAN_INFO, encode_info(INFO)),
            (
                "/desired_displacement",
                DISPLACEMENT,
                encode_block(DISPLACEMENT, INFO, block(first), last=False),
            ),
        ):
            schema = writer.register_schema(type_name, "ros2msg", b"")
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, 0, cdr, 0)
        writer.finish()


@pytest.mark.skipif(not FOREIGN.is_dir(), reason=f"no foreign bags at {FOREIGN}: AFM_SCAN_DATA")
@pytest.mark.parametrize(
    ("name", "there"),
    [
        ("talker", "/topic"),
        ("wbag", "AAA"),
        ("cdr_test", "/array_topic"),
        ("test_bag_for_seek", "topic"),
        ("only_topics.mcap", "/parameter_events"),
    ],
)
def test_a_foreign_bag_is_refused_with_what_it_holds(name: str, there: str) -> None:
    with pytest.raises(InputError, match=f"no scan_info.*{there}"):
        read_scan(FOREIGN / name)
