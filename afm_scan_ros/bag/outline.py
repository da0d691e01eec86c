"""What a bag's file holds, without reading more of it than that takes."""

from collections.abc import Iterator
from io import SEEK_END
from pathlib import Path
from typing import BinaryIO, cast

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.summary import Summary

from afm_scan_ros.bag.chunk import HEAD, RepeatedLayout, records, unpacked
from afm_scan_ros.bag.mcap_file import CUT, Bounded, RawMessage, messages, summary


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
