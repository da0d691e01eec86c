"""The message types of ``msg/``, and those of ROS that they use, for reading and writing bags."""

from collections.abc import Mapping
from functools import cache
from typing import Any, TypeAlias

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from afm_scan_ros.files.share import own_types

PACKAGE = "afm_scan_ros/msg"
FRAME = "scanner"

Message: TypeAlias = Any
"""Of a class that is made at run time from a definition, by rosbags, rosidl or the stand-in."""


@cache
def typestore() -> Typestore:
    """Return the types of ROS 2 Jazzy together with this package's own."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(own_types())
    return store


def encode(name: str, stamp: int, fields: Mapping[str, Any]) -> bytes:
    """CDR of a message of type ``name``, as ``afm_scan_ros/msg/ScanInfo``.

    ``stamp`` is its header's, in ns; ``fields`` are all the others.
    """
    types = typestore().types
    seconds, nanoseconds = divmod(stamp, 10**9)
    time = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    header = types["std_msgs/msg/Header"](stamp=time, frame_id=FRAME)
    return bytes(typestore().serialize_cdr(types[name](header=header, **fields), name))


def decode(name: str, cdr: bytes) -> Message:
    """Message of type ``name`` from its CDR; raises ValueError where it is not one."""
    try:
        return typestore().deserialize_cdr(cdr, name)
    except Exception as error:  # rosbags raises whatever its generated code runs into
        raise ValueError(f"not a {name}: {error}") from error


def stamp_of(message: Message) -> int:
    """Time in a message's header, which it must have, ns."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
