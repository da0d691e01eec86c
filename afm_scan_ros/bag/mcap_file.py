"""Messages of MCAP files in the order of recording, also of a file that was cut short."""

import struct
import zlib
from collections.abc import Iterator, Mapping
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import BinaryIO, cast

import lz4.frame
import numpy as np
import zstandard
from attrs import define, frozen
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Schema, Statistics
from mcap.stream_reader import CRCValidationError, read_magic
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError

LARGEST = 2**27
"""Bytes that a chunk may unpack to; recorders write a few MB."""

HEAD = struct.Struct("<BQ")
"""Of a record: what it is, and its length."""
_MESSAGE = struct.Struct("<HIQQ")  # of a message: channel, sequence, and both its times
_MOST_OTHERS = 2**17
"""Records of a chunk that are no messages: schemas and channels have numbers of 16 bits each."""
_TOGETHER, _MOST_TOGETHER = 64, 2**16
"""Messages looked at together, at first and at most: where lengths vary, it is in vain."""


@frozen(eq=False)
class RepeatedLayout:
    """Messages of one length, one behind the other: their channels (n,), their bytes (n, size)."""

    channels: NDArray[np.uint16]
    cdrs: NDArray[np.uint8]


def records(data: bytes) -> Iterator[Schema | Channel | RepeatedLayout]:
    """Yield the records of a chunk; ``mcap`` itself would read each field of each from a stream.

    Raises EOFError or struct.error where one ends beyond the chunk.
    """
    place = others = 0
    together = _TOGETHER
    while place < len(data):
        kind, size = HEAD.unpack_from(data, place)
        end = place + HEAD.size + size
        if end > len(data):
            raise EOFError(f"a record of {size} bytes in a chunk that ends before")
        if kind == Opcode.MESSAGE:
            yield (messages := _alike(data, place, end - place, together))
            alike = len(messages.channels)
            together = min(_MOST_TOGETHER, 4 * together) if alike == together else _TOGETHER
            place += alike * (end - place)
            continue
        others += 1
        if others > _MOST_OTHERS:
            raise ValueError(f"a chunk of over {_MOST_OTHERS} records that are no messages")
        if kind == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(data[place + HEAD.size : end])))
        elif kind == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(data[place + HEAD.size : end])))
        place = end


def _alike(data: bytes, place: int, stride: int, most: int) -> RepeatedLayout:
    """Return the message at a place, with those behind it that are as long."""
    if stride < HEAD.size + _MESSAGE.size:
        raise EOFError(f"a message of {stride - HEAD.size} bytes, which ends before its times")
    count = min((len(data) - place) // stride, most)
    rows = np.ndarray((count, stride), np.uint8, data, place)
    same = (rows[:, : HEAD.size] == rows[0, : HEAD.size]).all(axis=1)
    rows = rows[: count if same.all() else same.argmin()]
    channels = np.ndarray((len(rows),), "<u2", data, place + HEAD.size, (stride,))
    return RepeatedLayout(channels, rows[:, HEAD.size + _MESSAGE.size :])


def unpacked(chunk: Chunk) -> bytes:
    """Return what a chunk holds, without compression.

    Raises ValueError or CRCValidationError where that is not what the chunk states.
    """
    data = _of_stated_size(chunk)
    if chunk.uncompressed_crc and (found := zlib.crc32(data)) != chunk.uncompressed_crc:
        raise CRCValidationError(expected=chunk.uncompressed_crc, actual=found, record=chunk)
    return data


def _of_stated_size(chunk: Chunk) -> bytes:
    size = chunk.uncompressed_size
    if size > LARGEST:
        raise ValueError(f"a chunk of {size} bytes, over {LARGEST}")
    try:
        data = _decompressed(chunk, size + 1)
    except (zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"a chunk that is no {chunk.compression}: {error}") from error
    if len(data) != size:
        raise ValueError(f"a chunk of another size than the {size} bytes that it states")
    return data


def _decompressed(chunk: Chunk, most: int) -> bytes:
    match chunk.compression:
        case "":
            return chunk.data
        case "zstd":
            with zstandard.ZstdDecompressor().stream_reader(BytesIO(chunk.data)) as stream:
                return stream.read(most)
        case "lz4":
            data: bytes = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=most)
            return data
        case unknown:
            raise ValueError(f"a chunk compressed by '{unknown}': give zstd, lz4 or none")


_DATA_END = struct.Struct("<BQI")  # kind, length, checksum of all records before it
_FOOTER = struct.Struct("<BQQQI")  # kind, length, where the summary begins, its index, its checksum
_ENCODING_SIZE = 4  # of a message in CDR: what names the encoding
_PIECE = 2**20  # bytes of what is passed over, read at once

# What comes of taking the last bytes of a file that was cut for a footer.
UNREADABLE = (struct.error, ValueError, OSError)

# What a reader runs into where a file was cut: any record may end anywhere.
CUT = (McapError, struct.error, EOFError, ValueError)


@frozen
class RawMessage:
    """A message as it lies in the file; ``type_name`` is empty where it has no schema."""

    topic: str
    type_name: str
    cdr: bytes


@frozen(eq=False)
class RawMessages:
    """Messages of a topic as they lie in the file, of one length: ``cdrs`` is (n, length)."""

    topic: str
    type_name: str
    cdrs: NDArray[np.uint8]


@define
class Bounded:
    """A file that takes no memory for more than it holds, whatever its records state."""

    stream: BinaryIO
    size: int
    position: int = 0

    def read(self, size: int) -> bytes:
        """Return as many bytes; raises EOFError where the file has fewer."""
        if size > self.size - self.position:
            raise EOFError(f"{size} bytes are stated, {self.size - self.position} remain")
        self.position += size
        return self.stream.read(size)


def is_mcap(path: Path) -> bool:
    """Return whether a file begins as an MCAP file does, or as one that was cut at once."""
    with path.open("rb") as stream:
        return MCAP0_MAGIC.startswith(stream.read(len(MCAP0_MAGIC)))


def is_whole(path: Path) -> bool:
    """Return whether a file ends as an MCAP file does; one that a crash cut short does not."""
    end = len(MCAP0_MAGIC)
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - end))
        return size > 2 * end and stream.read() == MCAP0_MAGIC


def messages(path: Path) -> Iterator[RawMessage]:
    """Yield the messages of one file, one by one; see ``runs``."""
    for run in runs(path):
        for cdr in run.cdrs:
            yield RawMessage(run.topic, run.type_name, cdr.tobytes())


def runs(path: Path) -> Iterator[RawMessages]:
    """Yield the messages of one file; those of a file cut short up to its last whole chunk.

    Those of one topic come in their order, some together where all that lie there are as long.
    Raises InputError where a file is damaged rather than cut: a checksum fails, or a whole file
    has another number of messages than it states.
    """
    with path.open("rb") as stream:
        bounded = Bounded(stream, path.stat().st_size)
        try:
            yield from _runs(bounded, checked=data_is_checked(path))
        except CUT as error:
            if isinstance(error, CRCValidationError) or is_whole(path):
                where = f"{path} is damaged before byte {bounded.position}"
                raise InputError(f"{where} ({error}): record it again") from error


def _runs(stream: Bounded, *, checked: bool) -> Iterator[RawMessages]:
    schemas: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    count = 0
    for record in _records(stream, checked=checked):
        match record:
            case RepeatedLayout():
                count += len(record.channels)
                yield from _of_topics(record, channels, schemas)
            case Schema():
                schemas[record.id] = record.name
            case Channel():
                channels[record.id] = record
            case Statistics() if record.message_count != count:
                raise McapError(f"{count} of {record.message_count} messages are there")
            case _:
                pass


def _records(
    stream: Bounded, *, checked: bool
) -> Iterator[Schema | Channel | RepeatedLayout | Statistics]:
    """Yield what counts; the indexes only repeat where messages lie, and would take as long."""
    source = ReadDataStream(cast("BinaryIO", stream), calculate_crc=checked)
    read_magic(source)
    kind = 0
    while kind != Opcode.FOOTER:
        before = source.checksum() if checked else 0
        kind, size = HEAD.unpack(source.read(HEAD.size))
        end = source.count + size
        yield from _record(source, kind, size, before)
        if source.count > end:
            raise EOFError(f"a record that ends behind the {size} bytes that it states")
        while source.count < end:
            source.read(min(end - source.count, _PIECE))
    read_magic(source)


def _record(
    source: ReadDataStream, kind: int, size: int, checksum: int
) -> Iterator[Schema | Channel | RepeatedLayout | Statistics]:
    """Yield a record, or those of a chunk; ``checksum`` is that of all before, 0 if none."""
    if kind == Opcode.CHUNK:
        yield from records(unpacked(Chunk.read(source)))
    elif kind == Opcode.MESSAGE:
        yield from records(HEAD.pack(kind, size) + source.read(size))
    elif kind == Opcode.SCHEMA:
        yield Schema.read(source)
    elif kind == Opcode.CHANNEL:
        yield Channel.read(source)
    elif kind == Opcode.STATISTICS:
        yield Statistics.read(source)
    elif kind == Opcode.DATA_END:
        stated = (end := DataEnd.read(source)).data_section_crc
        if stated and checksum and stated != checksum:
            raise CRCValidationError(expected=stated, actual=checksum, record=end)


def _of_topics(
    messages: RepeatedLayout, channels: Mapping[int, Channel], schemas: Mapping[int, str]
) -> Iterator[RawMessages]:
    for number in dict.fromkeys(messages.channels.tolist()):
        if number not in channels:
            raise McapError(f"a message of channel {number}, which is not declared")
        channel, cdrs = channels[number], _rows(messages.cdrs, messages.channels == number)
        if channel.message_encoding == "cdr" and cdrs.shape[1] < _ENCODING_SIZE:
            raise McapError(f"a message of {channel.topic} without its encoding")
        yield RawMessages(channel.topic, schemas.get(channel.schema_id, ""), cdrs)


def _rows(cdrs: NDArray[np.uint8], wanted: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Rows that are wanted, without a copy where they lie at equal distances, as in turns."""
    places = np.flatnonzero(wanted)
    first, step = places[0], places[1] - places[0] if len(places) > 1 else 1
    in_turns = slice(first, places[-1] + 1, step)
    even = np.array_equal(places, np.arange(first, places[-1] + 1, step))
    return cdrs[in_turns] if even else cdrs[places]


def data_is_checked(path: Path) -> bool:
    """Return whether a file may have a checksum of its records; those of chunks are beside it."""
    with path.open("rb") as stream:
        try:
            start, _ = footer(stream)
            stream.seek((start or _place_of_footer(stream)) - _DATA_END.size)
            *_, checksum = _DATA_END.unpack(stream.read(_DATA_END.size))
        except UNREADABLE:
            return True
        return bool(checksum)


def footer(stream: BinaryIO) -> tuple[int, int]:
    """Return where the summary begins, 0 if there is none, and its checksum."""
    place = stream.seek(_place_of_footer(stream))
    _, _, start, _, checksum = _FOOTER.unpack(stream.read(_FOOTER.size))
    if start > place:
        raise ValueError("no footer")
    return start, checksum


def _place_of_footer(stream: BinaryIO) -> int:
    return stream.seek(0, SEEK_END) - len(MCAP0_MAGIC) - _FOOTER.size
