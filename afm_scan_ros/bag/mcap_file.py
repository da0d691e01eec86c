"""Messages of MCAP files in the order of recording, also of a file that was cut short."""

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, cast

from attrs import define, field, frozen
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Schema, Statistics
from mcap.stream_reader import CRCValidationError, StreamReader
from mcap.writer import MCAP0_MAGIC

from afm_scan_ros.bag.chunk import records, unpacked
from afm_scan_ros.bag.file_end import data_is_checked
from afm_scan_ros.core.errors import InputError

# What a reader runs into where a file was cut: any record may end anywhere.
CUT = (McapError, struct.error, EOFError, ValueError)


@frozen
class RawMessage:
    """A message as it lies in the file; ``type_name`` is empty where it has no schema."""

    topic: str
    type_name: str
    cdr: bytes


class _WithoutIndex(StreamReader):
    """Passes by what only repeats where messages lie, which would take as long as they do."""

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        if opcode in (Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX):
            return None
        return super()._read_record(opcode, length)


@define
class _Bounded:
    """A file that takes no memory for more than it holds, whatever its records say."""

    stream: BinaryIO
    size: int
    position: int = field(default=0, init=False)

    def read(self, size: int) -> bytes:
        """Return as many bytes; raises EOFError where the file has fewer."""
        if size > self.size - self.position:
            raise EOFError(f"{size} bytes are stated, {self.size - self.position} are left")
        self.position += size
        return self.stream.read(size)


def is_mcap(path: Path) -> bool:
    """Tell whether a file begins as an MCAP file does, or as one that was cut at once."""
    with path.open("rb") as stream:
        return MCAP0_MAGIC.startswith(stream.read(len(MCAP0_MAGIC)))


def is_whole(path: Path) -> bool:
    """Tell whether a file ends as an MCAP file does; one that a crash cut short does not."""
    end = len(MCAP0_MAGIC)
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - end))
        return size > 2 * end and stream.read() == MCAP0_MAGIC


def messages(path: Path) -> Iterator[RawMessage]:
    """Yield the messages of one file; those of a file cut short up to its last whole chunk.

    Raises InputError where a file is damaged rather than cut: a checksum fails, or a whole file
    has another number of messages than it says.
    """
    with path.open("rb") as stream:
        bounded = _Bounded(stream, path.stat().st_size)
        try:
            yield from _messages(bounded, checked=data_is_checked(path))
        except CUT as error:
            if isinstance(error, CRCValidationError) or is_whole(path):
                where = f"{path} is damaged before byte {bounded.position}"
                raise InputError(f"{where} ({error}): record it again") from error


def _messages(stream: _Bounded, *, checked: bool) -> Iterator[RawMessage]:
    schemas: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    count = 0
    for record in _records(stream, checked=checked):
        match record:
            case Message():
                count += 1
                yield _raw(record, channels, schemas)
            case Schema():
                schemas[record.id] = record.name
            case Channel():
                channels[record.id] = record
            case Statistics() if record.message_count != count:
                raise McapError(f"{count} of {record.message_count} messages are there")
            case _:
                pass


def _records(stream: _Bounded, *, checked: bool) -> Iterator[McapRecord]:
    source = cast("BinaryIO", stream)
    for record in _WithoutIndex(source, emit_chunks=True, validate_crcs=checked).records:
        if isinstance(record, Chunk):
            yield from records(unpacked(record))
        else:
            yield record


def _raw(
    message: Message, channels: Mapping[int, Channel], schemas: Mapping[int, str]
) -> RawMessage:
    if message.channel_id not in channels:
        raise McapError(f"a message of channel {message.channel_id}, of which nothing is said")
    channel = channels[message.channel_id]
    return RawMessage(channel.topic, schemas.get(channel.schema_id, ""), message.data)
