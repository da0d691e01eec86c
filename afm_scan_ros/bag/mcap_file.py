"""Messages of MCAP files in the order of recording, also of a file that was cut short."""

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path

from attrs import frozen
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import CRCValidationError, StreamReader
from mcap.writer import MCAP0_MAGIC

from afm_scan_ros.core.errors import InputError

# What a reader runs into where a file was cut: any record may end anywhere.
_CUT = (McapError, struct.error, EOFError)


@frozen
class RawMessage:
    """A message as it lies in the file; ``type_name`` is empty where it has no schema."""

    topic: str
    type_name: str
    cdr: bytes


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

    Raises InputError where a file is damaged rather than cut.
    """
    try:
        yield from _messages(path)
    except CRCValidationError as error:
        raise InputError(f"{path} is damaged ({error}): record it again") from error
    except _CUT as error:
        if is_whole(path):
            raise InputError(f"{path} is damaged ({error}): record it again") from error


def _messages(path: Path) -> Iterator[RawMessage]:
    schemas: dict[int, str] = {}
    channels: dict[int, Channel] = {}
    with path.open("rb") as stream:
        for record in StreamReader(stream, validate_crcs=True).records:
            match record:
                case Schema():
                    schemas[record.id] = record.name
                case Channel():
                    channels[record.id] = record
                case Message():
                    yield _raw(record, channels, schemas)
                case _:
                    pass


def _raw(
    message: Message, channels: Mapping[int, Channel], schemas: Mapping[int, str]
) -> RawMessage:
    channel = channels[message.channel_id]
    return RawMessage(channel.topic, schemas.get(channel.schema_id, ""), message.data)
