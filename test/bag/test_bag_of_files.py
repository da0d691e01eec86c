"""A long scan is recorded into several files, which are read as one."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from afm_scan_ros.bag import writer as bag_writer
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Array, Trace

PERIOD = 1e-2
INFO = ScanInfo("scan-1", 0, "creep", PERIOD, 1000)
BLOCK = 50
CHUNKS = 3
STREAM = "achieved_displacement"


def samples(first: int, stop: int) -> Array:
    return np.arange(first, stop, dtype=np.float64)


@pytest.fixture
def writer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ScanWriter:
    """Record ten seconds of scan, a chunk each."""
    monkeypatch.setattr(bag_writer, "FILE_CHUNKS", CHUNKS)
    writer = ScanWriter(tmp_path / "bag", INFO)
    for first in range(0, INFO.total_samples, BLOCK):
        x = samples(first, first + BLOCK)
        writer.add(STREAM, Trace(first, PERIOD, x, -x))
    return writer


@pytest.fixture
def bag(writer: ScanWriter, tmp_path: Path) -> Path:
    with writer:
        pass
    return tmp_path / "bag"


def test_no_file_holds_more_chunks_than_it_may(bag: Path) -> None:
    files = sorted(bag.glob("bag_*.mcap"))
    counts = []
    for file in files:
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        counts.append(len(summary.chunk_indexes))
    assert len(files) > 2
    assert max(counts) <= CHUNKS
    assert min(counts) > 0


def test_they_read_as_one(bag: Path) -> None:
    recording = read_scan(bag)
    assert recording.warnings == ()
    assert np.array_equal(recording.whole(STREAM).x, samples(0, 1000))
    with AnyReader([bag]) as reader:
        assert sum(1 for _ in reader.messages()) == reader.message_count == 1 + 1000 // BLOCK


def test_metadata_lists_what_lies_in_each(bag: Path) -> None:
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert [each["path"] for each in metadata["files"]] == metadata["relative_file_paths"]
    assert sum(each["message_count"] for each in metadata["files"]) == metadata["message_count"]
    starts = [each["starting_time"]["nanoseconds_since_epoch"] for each in metadata["files"]]
    assert starts == sorted(set(starts))


def test_messages_are_counted_on_from_file_to_file(bag: Path) -> None:
    numbers = []
    for name in read_scan(bag)._files:  # noqa: SLF001 - in the order of recording
        with name.open("rb") as stream:
            numbers += [m.sequence for _, _, m in make_reader(stream).iter_messages([f"/{STREAM}"])]
    assert numbers == list(range(1000 // BLOCK))


def test_a_recorder_that_is_killed_leaves_the_files_before(
    writer: ScanWriter, tmp_path: Path
) -> None:
    recording = read_scan(tmp_path / "bag")
    kept = recording.whole(STREAM).x
    assert np.array_equal(kept, samples(0, kept.size))
    assert kept.size >= 1000 - 3 * BLOCK
    assert "metadata.yaml" in recording.warnings[0]
    assert ["cut short" in each for each in recording.warnings[1:]] == [True]
    with writer:
        pass


def test_a_later_file_by_itself_is_part_of_a_record(bag: Path) -> None:
    recording = read_scan(bag / "bag_1.mcap")
    (warning,) = recording.warnings
    assert "holds no scan_info: it is taken as a record" in warning
    assert f"read {bag}" in warning
    (part,) = recording.together(STREAM)
    assert part.first_sample > 0
    assert np.array_equal(part.x, samples(part.first_sample, part.first_sample + part.x.size))
    with pytest.raises(InputError, match=rf"samples 0 to {part.first_sample - 1} are missing"):
        recording.whole(STREAM)
