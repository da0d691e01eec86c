"""What a whole MCAP file says of itself at its end, so that not all of it need be read for that."""

import struct
import zlib
from io import SEEK_END
from pathlib import Path
from typing import BinaryIO

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.summary import Summary

from afm_scan_ros.bag.chunk import LARGEST

_DATA_END = struct.Struct("<BQI")  # kind, length, checksum of all records before it
_FOOTER = struct.Struct("<BQQQI")  # kind, length, where the summary begins, its index, its checksum
_MAGIC_SIZE = 8
_CHECKSUM_SIZE = 4

# What comes of taking the last bytes of a file that was cut for a footer.
_UNREADABLE = (struct.error, ValueError, OSError)


def summary(path: Path) -> Summary | None:
    """Read the summary of a file; None where there is none, or none with a checksum that holds."""
    with path.open("rb") as stream:
        try:
            start, checksum = _footer(stream)
            size = stream.seek(0, SEEK_END) - _MAGIC_SIZE - _CHECKSUM_SIZE - start
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
    """Tell whether a file may have a checksum of its records; those of chunks are beside it."""
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
    return stream.seek(0, SEEK_END) - _MAGIC_SIZE - _FOOTER.size
