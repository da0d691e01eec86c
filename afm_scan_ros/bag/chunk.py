"""A chunk of an MCAP file unpacked, in no more memory than it says it needs."""

from dataclasses import replace
from io import BytesIO

import lz4.frame
import zstandard
from mcap.records import Chunk

LARGEST = 2**28
"""Bytes that a chunk may unpack to; recorders write a few MB."""


def unpacked(chunk: Chunk) -> Chunk:
    """Return the chunk without compression; raises ValueError where it is not what it says."""
    size = chunk.uncompressed_size
    if size > LARGEST:
        raise ValueError(f"a chunk of {size} bytes, over {LARGEST}")
    try:
        data = _decompressed(chunk, size + 1)
    except (zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"a chunk that is no {chunk.compression}: {error}") from error
    if len(data) != size:
        raise ValueError(f"a chunk of another size than the {size} bytes that it states")
    return replace(chunk, compression="", data=data)


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
