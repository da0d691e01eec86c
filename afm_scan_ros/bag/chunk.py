"""The records in a chunk of an MCAP file, in no more memory than it says it needs."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import CRCValidationError

LARGEST = 2**28
"""Bytes that a chunk may unpack to; recorders write a few MB."""

_HEAD = struct.Struct("<BQ")  # of a record: what it is, and its length
_MESSAGE = struct.Struct("<HIQQ")  # of a message: channel, sequence, and both its times


def records(data: bytes) -> Iterator[Schema | Channel | Message]:
    """Yield the records of a chunk; ``mcap`` itself would read each field of each from a stream.

    Raises EOFError or struct.error where one ends beyond the chunk.
    """
    place = 0
    while place < len(data):
        kind, size = _HEAD.unpack_from(data, place)
        body = data[place + _HEAD.size : place + _HEAD.size + size]
        if len(body) < size:
            raise EOFError(f"a record of {size} bytes in a chunk that ends before")
        place += _HEAD.size + size
        if kind == Opcode.MESSAGE:
            channel, sequence, logged, published = _MESSAGE.unpack_from(body)
            yield Message(channel, logged, body[_MESSAGE.size :], published, sequence)
        elif kind == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(body)))
        elif kind == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(body)))


def unpacked(chunk: Chunk) -> bytes:
    """Return what a chunk holds, without compression.

    Raises ValueError or CRCValidationError where that is not what the chunk says.
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
