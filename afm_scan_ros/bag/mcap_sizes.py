"""What an MCAP file states of its size, looked at before any of it is unpacked."""

import struct
from pathlib import Path

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.unfolding import FREE, refuse_unfolding

HEAD = struct.Struct("<BQ")
"""Of a record: what it is, and its length."""
_CHUNK_HEAD = struct.Struct("<QQQ")  # both times of a chunk, and the bytes that it unpacks to
_FEW = 10**5
_LEAST = 50
"""Records beside messages that any file may have, and bytes of each in a larger one at least.

A chunk and its indices have more.
"""


def refuse_sizes(path: Path) -> None:
    """Raise InputError where a file states more than a recording of its size can hold."""
    size, count, unpacked = path.stat().st_size, 0, 0
    try:
        with path.open("rb") as stream:
            place = stream.seek(len(MCAP0_MAGIC))
            while place + HEAD.size <= size and count <= _FEW + size / _LEAST:
                kind, length = HEAD.unpack(stream.read(HEAD.size))
                if kind == Opcode.CHUNK and place + HEAD.size + _CHUNK_HEAD.size <= size:
                    *_, stated = _CHUNK_HEAD.unpack(stream.read(_CHUNK_HEAD.size))
                    unpacked += stated if stated <= FREE else 0  # it is not unpacked
                    refuse_unfolding(unpacked, size)
                count += kind != Opcode.MESSAGE
                place += HEAD.size + length
                stream.seek(min(place, size))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    if count > _FEW + size / _LEAST:
        raise InputError(
            f"{path}: over {count} records beside messages in {size} bytes: record it again"
        )
