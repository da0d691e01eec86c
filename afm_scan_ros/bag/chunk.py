"""The records in a chunk of an MCAP file, in no more memory than it states that it needs."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

import lz4.frame
import numpy as np
import zstandard
from attrs import frozen
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import CRCValidationError
from numpy.typing import NDArray

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
