"""The summary at the end of a whole MCAP file, which is read without reading all of it."""

import zlib
from collections import Counter
from collections.abc import Iterator
from io import SEEK_END, BytesIO
from itertools import islice
from pathlib import Path
from typing import BinaryIO, cast

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Schema, Statistics
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from afm_scan_ros.bag import mcap_file
from afm_scan_ros.files.arrays import refuse_unfolding

LARGEST = 2**23
"""Bytes of a summary that is read; that of a larger one is of a hundred thousand chunks."""
CHECKSUM_SIZE = 4
MOST_WANTED = 10**4
"""Messages of the wanted type that are looked for by the index."""


def summary(path: Path) -> Summary | None:
    """Read the summary of a file; None where there is none, or none with a checksum that holds."""
    with path.open("rb") as stream:
        try:
            start, checksum = mcap_file.footer(stream)
            size = stream.seek(0, SEEK_END) - len(MCAP0_MAGIC) - CHECKSUM_SIZE - start
            if not start or size > LARGEST:
                return None
            stream.seek(start)
            content = stream.read(size)
            return _summary(content) if zlib.crc32(content) == checksum else None
        except (*mcap_file.CUT, OSError):
            return None


def _summary(content: bytes) -> Summary:
    found, place, kind = Summary(), 0, 0
    while kind != Opcode.FOOTER:
        kind, size = mcap_file.HEAD.unpack_from(content, place)
        place += mcap_file.HEAD.size + size
        source = ReadDataStream(BytesIO(content[place - size : place]))
        if kind == Opcode.SCHEMA:
            schema: Schema = Schema.read(source)
            found.schemas[schema.id] = schema
        elif kind == Opcode.CHANNEL:
            channel: Channel = Channel.read(source)
            found.channels[channel.id] = channel
        elif kind == Opcode.STATISTICS:
            found.statistics = Statistics.read(source)
        elif kind == Opcode.CHUNK_INDEX:
            found.chunk_indexes.append(ChunkIndex.read(source))
    return found


def outline(path: Path, wanted: str) -> Iterator[mcap_file.RawMessage]:
    """Yield each message of the type ``wanted``, and an empty one of each other topic.

    A file whose summary does not hold is read as a whole, with all its messages. Raises InputError
    where that is damaged.
    """
    found = summary(path)
    try:
        listed = None if found is None else list(_listed(path, found, wanted))
    except mcap_file.CUT:
        listed = None
    yield from _read_through(path, wanted) if listed is None else listed


def _read_through(path: Path, wanted: str) -> Iterator[mcap_file.RawMessage]:
    seen: set[str] = set()
    for run in mcap_file.runs(path):
        if run.type_name == wanted:
            yield from (mcap_file.RawMessage(run.topic, wanted, cdr.tobytes()) for cdr in run.cdrs)
        elif run.topic not in seen:
            seen.add(run.topic)
            yield mcap_file.RawMessage(run.topic, run.type_name, b"")


def _listed(path: Path, found: Summary, wanted: str) -> Iterator[mcap_file.RawMessage]:
    if found.statistics is None or not all(i.message_index_offsets for i in found.chunk_indexes):
        raise McapError("no index of messages")
    schemas = {number: schema.name for number, schema in found.schemas.items()}
    counts = found.statistics.channel_message_counts
    for number, channel in found.channels.items():
        if not counts.get(number):
            continue
        type_name = schemas.get(channel.schema_id, "")
        if type_name == wanted:
            texts = Counter(islice(_of_channel(path, found, number), MOST_WANTED))
            if texts.total() != counts[number]:
                raise McapError("the index lacks messages, or has very many")
            yield from (mcap_file.RawMessage(channel.topic, type_name, cdr) for cdr in texts)
        else:
            yield mcap_file.RawMessage(channel.topic, type_name, b"")


def _of_channel(path: Path, found: Summary, number: int) -> Iterator[bytes]:
    places = {
        i.chunk_start_offset for i in found.chunk_indexes if number in i.message_index_offsets
    }
    size, unfolded = path.stat().st_size, 0
    with path.open("rb") as stream:
        for place in sorted(places):
            data = mcap_file.unpacked(_chunk(stream, place))
            refuse_unfolding(unfolded := unfolded + len(data), size)
            for record in mcap_file.records(data):
                if isinstance(record, mcap_file.RepeatedLayout):
                    yield from map(bytes, record.cdrs[record.channels == number])


def _chunk(stream: BinaryIO, place: int) -> Chunk:
    size = stream.seek(0, SEEK_END)
    if place > size:
        raise McapError("an index of what lies behind the end")
    bounded = mcap_file.Bounded(stream, size, stream.seek(place))
    source = ReadDataStream(cast("BinaryIO", bounded))
    kind, _ = mcap_file.HEAD.unpack(source.read(mcap_file.HEAD.size))
    if kind != Opcode.CHUNK:
        raise McapError("no chunk where the index states")
    chunk: Chunk = Chunk.read(source)
    return chunk
