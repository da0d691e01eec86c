"""Messages of MCAP files in the order of recording, also of a file that was cut short.

The summary at the end of a whole file is read without reading all of it.
"""

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
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, DataEnd, Schema, Statistics
from mcap.stream_reader import CRCValidationError, read_magic
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError

LARGEST = 2**28
"""Bytes that a chunk may unpack to; recorders write a few MB."""

HEAD = struct.Struct("<BQ")
"""Of a record: what it is, and its length."""
_MESSAGE = struct.Struct("<HIQQ")  # of a message: channel, sequence, and both its times
_TOGETHER = 64
"""Messages looked at together, at most: where lengths vary, the look ahead is in vain."""


@frozen(eq=False)
class RepeatedLayout:
    """Messages of one length, one behind the other: their channels (n,), their bytes (n, size)."""

    channels: NDArray[np.uint16]
    cdrs: NDArray[np.uint8]


def records(data: bytes) -> Iterator[Schema | Channel | RepeatedLayout]:
    """Yield the records of a chunk; ``mcap`` itself would read each field of each from a stream.

    Raises EOFError or struct.error where one ends beyond the chunk.
    """
    place = 0
    while place < len(data):
        kind, size = HEAD.unpack_from(data, place)
        end = place + HEAD.size + size
        if end > len(data):
            raise EOFError(f"a record of {size} bytes in a chunk that ends before")
        if kind == Opcode.MESSAGE:
            yield (messages := _alike(data, place, end - place))
            end = place + len(messages.channels) * (end - place)
        elif kind == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(data[place + HEAD.size : end])))
        elif kind == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(data[place + HEAD.size : end])))
        place = end


def _alike(data: bytes, place: int, stride: int) -> RepeatedLayout:
    """Return the message at a place, with those behind it that are as long."""
    if stride < HEAD.size + _MESSAGE.size:
        raise EOFError(f"a message of {stride - HEAD.size} bytes, which ends before its times")
    count = min((len(data) - place) // stride, _TOGETHER)
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
    """Return the contents, cut off after so many bytes."""
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
_CHECKSUM_SIZE = 4

# What comes of taking the last bytes of a file that was cut for a footer.
_UNREADABLE = (struct.error, ValueError, OSError)

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
        source.read(end - source.count)
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
        yield RawMessages(channel.topic, schemas.get(channel.schema_id, ""), cdrs)


def _rows(cdrs: NDArray[np.uint8], wanted: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Rows that are wanted, without a copy where they lie at equal distances, as in turns."""
    places = np.flatnonzero(wanted)
    first, step = places[0], places[1] - places[0] if len(places) > 1 else 1
    in_turns = slice(first, places[-1] + 1, step)
    even = np.array_equal(places, np.arange(first, places[-1] + 1, step))
    return cdrs[in_turns] if even else cdrs[places]


def summary(path: Path) -> Summary | None:
    """Read the summary of a file; None where there is none, or none with a checksum that holds."""
    with path.open("rb") as stream:
        try:
            start, checksum = _footer(stream)
            size = stream.seek(0, SEEK_END) - len(MCAP0_MAGIC) - _CHECKSUM_SIZE - start
            if not start or size > LARGEST:
                return None
            stream.seek(start)
            if zlib.crc32(stream.read(size)) != checksum:
                return None
            stream.seek(0)
            return SeekingReader(stream).get_summary()
        except (McapError, *_UNREADABLE):
            return None


def data_is_checked(path: Path) -> bool:
    """Return whether a file may have a checksum of its records; those of chunks are beside it."""
    with path.open("rb") as stream:
        try:
            start, _ = _footer(stream)
            stream.seek((start or _place_of_footer(stream)) - _DATA_END.size)
            *_, checksum = _DATA_END.unpack(stream.read(_DATA_END.size))
        except _UNREADABLE:
            return True
        return bool(checksum)


def _footer(stream: BinaryIO) -> tuple[int, int]:
    """Return where the summary begins, 0 if there is none, and its checksum."""
    place = stream.seek(_place_of_footer(stream))
    _, _, start, _, checksum = _FOOTER.unpack(stream.read(_FOOTER.size))
    if start > place:
        raise ValueError("no footer")
    return start, checksum


def _place_of_footer(stream: BinaryIO) -> int:
    return stream.seek(0, SEEK_END) - len(MCAP0_MAGIC) - _FOOTER.size


def outline(path: Path, wanted: str) -> Iterator[RawMessage]:
    """Yield each message of the type ``wanted``, and an empty one of each other topic.

    A file whose summary does not hold is read as a whole, with all its messages. Raises InputError
    where that is damaged.
    """
    found = summary(path)
    try:
        listed = None if found is None else list(_listed(path, found, wanted))
    except CUT:
        listed = None
    yield from messages(path) if listed is None else listed


def _listed(path: Path, found: Summary, wanted: str) -> Iterator[RawMessage]:
    if found.statistics is None or not all(i.message_index_offsets for i in found.chunk_indexes):
        raise McapError("no index of messages")
    schemas = {number: schema.name for number, schema in found.schemas.items()}
    counts = found.statistics.channel_message_counts
    for number, channel in found.channels.items():
        if not counts.get(number):
            continue
        type_name = schemas.get(channel.schema_id, "")
        if type_name == wanted:
            texts = list(_of_channel(path, found, number))
            if len(texts) != counts[number]:
                raise McapError("the index lacks messages")
            yield from (RawMessage(channel.topic, type_name, cdr) for cdr in texts)
        else:
            yield RawMessage(channel.topic, type_name, b"")


def _of_channel(path: Path, found: Summary, number: int) -> Iterator[bytes]:
    with path.open("rb") as stream:
        for index in found.chunk_indexes:
            if number in index.message_index_offsets:
                for record in records(unpacked(_chunk(stream, index.chunk_start_offset))):
                    if isinstance(record, RepeatedLayout):
                        yield from map(bytes, record.cdrs[record.channels == number])


def _chunk(stream: BinaryIO, place: int) -> Chunk:
    size = stream.seek(0, SEEK_END)
    if place > size:
        raise McapError("an index of what lies behind the end")
    bounded = Bounded(stream, size, stream.seek(place))
    source = ReadDataStream(cast("BinaryIO", bounded))
    kind, _ = HEAD.unpack(source.read(HEAD.size))
    if kind != Opcode.CHUNK:
        raise McapError("no chunk where the index states")
    chunk: Chunk = Chunk.read(source)
    return chunk
