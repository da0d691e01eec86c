"""A byte of a bag that turned over is noticed or changes nothing, wherever it lies."""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from afm_scan_ros.bag.mcap_file import LARGEST
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import DISPLACEMENT, encode_block, encode_info
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace

PERIOD, SAMPLES, BLOCK = 1e-2, 400, 50
INFO = ScanInfo("scan-1", 0, "creep", PERIOD, SAMPLES)
RAMP = np.arange(SAMPLES, dtype=np.float64)
HEAD = struct.Struct("<BQ")
"""Of every record: its opcode, and the length of what follows."""


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Record four seconds, so that the file has as many chunks."""
    folder = tmp_path_factory.mktemp("bags") / "bag"
    with ScanWriter(folder, INFO) as writer:
        for first in range(0, SAMPLES, BLOCK):
            samples = RAMP[first : first + BLOCK]
            writer.add("achieved_displacement", Trace(first, PERIOD, samples, -samples))
    return (folder / "bag_0.mcap").read_bytes()


def records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield the opcode of each record, and where its contents begin and end."""
    start = 8
    while start < len(content) - 8:
        opcode, length = HEAD.unpack_from(content, start)
        yield opcode, start + HEAD.size, start + HEAD.size + length
        start += HEAD.size + length


def read(path: Path, content: bytes) -> np.ndarray:
    path.write_bytes(content)
    return read_scan(path).whole("achieved_displacement").x


def turned(content: bytes, place: int, bits: int = 0xFF) -> bytes:
    return content[:place] + bytes([content[place] ^ bits]) + content[place + 1 :]


def test_a_byte_that_is_no_sample_is_noticed_or_changes_nothing(
    content: bytes, tmp_path: Path
) -> None:
    """Of each record its kind and a byte of its length, of what else is no sample a few."""
    heads = {at for _, start, _ in records(content) for at in (start - 9, start - 8, start - 2)}
    samples = {
        at
        for opcode, start, end in records(content)
        if opcode == Opcode.CHUNK
        for at in range(start, end)
    }
    noticed = 0
    for place in sorted(heads | {*range(0, len(content), 13)} - samples):
        try:
            found = read(tmp_path / "bag.mcap", turned(content, place))
        except InputError as error:
            assert "bag.mcap" in str(error)  # noqa: PT017 - not every byte matters
            noticed += 1
        else:
            assert np.array_equal(found, RAMP), place
    assert noticed > 50


def test_a_byte_of_a_chunk_is_noticed(content: bytes, tmp_path: Path) -> None:
    _, start, end = next(r for r in records(content) if r[0] == Opcode.CHUNK)
    for place in range(start + 40, end, 31):
        with pytest.raises(InputError, match=r"bag\.mcap is damaged before byte \d+"):
            read(tmp_path / "bag.mcap", turned(content, place))


@pytest.mark.parametrize("which", [0, 1, -1])
def test_a_chunk_that_is_no_longer_one_is_missed(
    content: bytes, tmp_path: Path, which: int
) -> None:
    chunks = [start - HEAD.size for opcode, start, _ in records(content) if opcode == Opcode.CHUNK]
    for private in (0x80, 0xFF, 0x7F):  # kinds of records that readers are to pass by
        damaged = turned(content, chunks[which], Opcode.CHUNK ^ private)
        with pytest.raises(InputError):
            read(tmp_path / "bag.mcap", damaged)


def of_one_chunk(compression: str, size: int, data: bytes) -> bytes:
    """Return a file whose chunk states a compression and a size, whatever its data are."""
    name = compression.encode()
    body = struct.pack("<QQQII", 0, 0, size, 0, len(name)) + name
    body += struct.pack("<Q", len(data)) + data
    return MCAP0_MAGIC + HEAD.pack(Opcode.CHUNK, len(body)) + body + MCAP0_MAGIC


@pytest.mark.parametrize("place", [2**64 - 1, 2**63, 2**40, -1, -3, 8])
def test_an_index_that_points_elsewhere_is_not_believed(
    content: bytes, tmp_path: Path, place: int
) -> None:
    """Negative places count from the end; the summary's checksum holds, the bag is whole."""
    hostile = bytearray(content)
    for opcode, start, _ in records(content):
        if opcode == Opcode.CHUNK_INDEX:
            struct.pack_into(
                "<Q", hostile, start + 16, place % len(content) if place < 0 else place
            )
    summary = struct.unpack_from("<Q", content, len(content) - 28)[0]
    struct.pack_into("<I", hostile, len(content) - 12, zlib.crc32(hostile[summary:-12]))
    assert np.array_equal(read(tmp_path / "bag.mcap", bytes(hostile)), RAMP)


def test_a_chunk_longer_than_its_record_is_refused(content: bytes, tmp_path: Path) -> None:
    _, start, end = next(r for r in records(content) if r[0] == Opcode.CHUNK)
    shorter = HEAD.pack(Opcode.CHUNK, end - start - 1)
    with pytest.raises(InputError, match=r"is damaged before byte .* ends behind"):
        read(tmp_path / "bag.mcap", content[: start - HEAD.size] + shorter + content[start:])


ZEROS = bytes(2**26)
BOMBS = {
    "states too much": ("", 2**44, b""),
    "states more than it is": ("", 100, b""),
    "zstd, too much": ("zstd", LARGEST + 1, zstandard.compress(ZEROS)),
    "zstd, more than it states": ("zstd", 1000, zstandard.compress(ZEROS)),
    "lz4, more than it states": ("lz4", 1000, lz4.frame.compress(ZEROS)),
    "no zstd": ("zstd", 1000, b"no frame"),
    "no lz4": ("lz4", 1000, b"no frame"),
    "unknown": ("xz", 1000, b""),
}


@pytest.mark.parametrize("bomb", BOMBS.values(), ids=BOMBS)
def test_no_chunk_takes_more_memory_than_it_may(
    tmp_path: Path, bomb: tuple[str, int, bytes]
) -> None:
    with pytest.raises(InputError, match=r"is damaged before byte .* chunk"):
        read(tmp_path / "bag.mcap", of_one_chunk(*bomb))


@pytest.mark.parametrize("opcode", [Opcode.SCHEMA, Opcode.METADATA, 0x80])
def test_a_record_that_states_more_than_the_file_holds_is_refused(
    content: bytes, tmp_path: Path, opcode: int
) -> None:
    end = content.index(HEAD.pack(Opcode.DATA_END, 4))
    for length in (2**20, 2**32 + 5, 2**62):
        stated = HEAD.pack(opcode, length) + 6 * b"\xff"
        with pytest.raises(InputError, match=r"is damaged before byte .* (remain|exceeds limit)"):
            read(tmp_path / "bag.mcap", content[:end] + stated + content[end:])


@pytest.mark.parametrize("compression", CompressionType)
def test_compressed_chunks_are_read(tmp_path: Path, compression: CompressionType) -> None:
    trace = Trace(0, PERIOD, RAMP, -RAMP)
    messages = {
        "/scan_info": (SCAN_INFO, encode_info(INFO)),
        "/achieved_displacement": (
            DISPLACEMENT,
            encode_block(DISPLACEMENT, INFO, trace, last=True),
        ),
    }
    with (tmp_path / "bag.mcap").open("wb") as stream:
        writer = Writer(stream, compression=compression)
        writer.start()
        for topic, (kind, cdr) in messages.items():
            channel = writer.register_channel(
                topic, "cdr", writer.register_schema(kind, "ros2msg", b"")
            )
            writer.add_message(channel, 0, cdr, 0)
        writer.finish()
    found = read_scan(tmp_path / "bag.mcap").whole("achieved_displacement")
    assert np.array_equal(found.x, RAMP)


def test_a_file_that_metadata_no_longer_lists_is_missed(content: bytes, tmp_path: Path) -> None:
    for name in ("a_0.mcap", "a_1.mcap"):
        (tmp_path / name).write_bytes(content)
    listed = "rosbag2_bagfile_information:\n  relative_file_paths:\n  - a_0.mcap\n  # a_1.mcap\n"
    (tmp_path / "metadata.yaml").write_text(listed)
    (warning,) = read_scan(tmp_path).warnings
    assert "a_1.mcap is not read" in warning


@pytest.mark.parametrize("name", ["../a.mcap", "/tmp/a.mcap"])  # noqa: S108 - nothing is made there
def test_no_file_outside_a_bag_is_read(tmp_path: Path, name: str) -> None:
    listed = f"rosbag2_bagfile_information: {{relative_file_paths: [{name}]}}"
    (tmp_path / "metadata.yaml").write_text(listed)
    with pytest.raises(InputError, match=f"{name}, which is not in the bag's folder"):
        read_scan(tmp_path)
