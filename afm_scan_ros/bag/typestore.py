"""The message types of bags: where their fields lie, and what those of monitors hold.

With the places of the fields numpy reads many messages at once. The definitions in ``msg/`` list
the fields; how long strings and sequences are is taken from one message, whose shape the others
must have. Alignment: OMG, Common Object Request Broker Architecture, 15.3: each number lies at a
multiple of its own size, counted after the four bytes that name the encoding.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from attrs import define, field, frozen
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.streams import LineError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files import own_types

PACKAGE = "afm_scan_ros/msg"
FRAME = "scanner"

Message: TypeAlias = Any
"""Of a class that is made at run time from a definition, by rosbags or rosidl."""


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


_LITTLE_ENDIAN = b"\x00\x01"
ENCODING_SIZE = 4
_COUNT_SIZE = 4


@frozen(eq=False)
class MessageLayout:
    """``fields`` lie so in each message whose bytes ``shaping`` (indices) are ``shape``."""

    fields: np.dtype[np.void]
    shaping: NDArray[np.intp]
    shape: bytes

    def table(self, cdrs: NDArray[np.uint8]) -> NDArray[np.void] | None:
        """Fields of messages by name (n,), of their bytes (n, size); None for another shape."""
        if cdrs.shape[1] != self.fields.itemsize:
            return None
        same = cdrs[:, self.shaping].tobytes() == len(cdrs) * self.shape
        return cdrs.view(self.fields)[:, 0] if same else None


def layout_of(type_name: str, cdr: NDArray[np.uint8]) -> MessageLayout:
    """Layout of the messages of a type with the shape of one, of the bytes ``cdr`` (size,).

    Nested fields have names as ``header.stamp.sec``. Strings, as bytes, belong to the shape, as do
    counts. Raises ValueError where it is no such message, or not little-endian.
    """
    message = decode(type_name, cdr.tobytes())
    if cdr[: len(_LITTLE_ENDIAN)].tobytes() != _LITTLE_ENDIAN:
        raise ValueError("not little-endian")
    cursor = _Cursor()
    cursor.pass_message(type_name, message, "")
    names, formats, offsets = zip(*cursor.fields, strict=True)
    fields = np.dtype(
        {"names": names, "formats": formats, "offsets": offsets, "itemsize": len(cdr)}
    )
    shaping = np.concatenate(cursor.shaping)
    return MessageLayout(fields, shaping, cdr[shaping].tobytes())


@define
class _Cursor:
    """Passes through a message and notes where its fields lie, and what shapes it."""

    place: int = 0
    fields: list[tuple[str, Any, int]] = field(factory=list)
    shaping: list[NDArray[np.intp]] = field(factory=lambda: [np.arange(ENCODING_SIZE)])

    def pass_message(self, type_name: str, message: Message, prefix: str) -> None:
        definitions: list[Any] = typestore().fielddefs[type_name][1]
        for name, (kind, of) in definitions:
            value = getattr(message, name)
            if kind == Nodetype.NAME:
                self.pass_message(of, value, f"{prefix}{name}.")
            elif kind == Nodetype.SEQUENCE:
                self._pass_shaping(_COUNT_SIZE, _COUNT_SIZE)
                self._pass_field(prefix + name, np.dtype(of[0][1][0]), (len(value),))
            elif of[0] == "string":
                self._pass_shaping(_COUNT_SIZE, _COUNT_SIZE)
                self._pass_field(prefix + name, np.dtype(np.uint8), (len(value.encode()),))
                self.shaping.append(np.arange(self.fields[-1][-1], ENCODING_SIZE + self.place))
                self._pass_shaping(1, 1)
            else:
                self._pass_field(prefix + name, np.dtype(of[0]), ())

    def _pass_shaping(self, size: int, alignment: int) -> None:
        start = self._aligned(alignment)
        self.shaping.append(np.arange(start, start + size))
        self.place += size

    def _pass_field(self, name: str, number: np.dtype[Any], shape: tuple[int, ...]) -> None:
        start = self._aligned(number.itemsize)
        self.fields.append((name, (number.newbyteorder("<"), shape), start))
        self.place += number.itemsize * int(np.prod(shape))

    def _aligned(self, size: int) -> int:
        self.place += -self.place % size
        return ENCODING_SIZE + self.place


IMAGE = "sensor_msgs/msg/Image"
WAYS = {"scan_image/trace": "trace", "scan_image/retrace": "retrace"}
"""Ends of topics of images, and the directions that they show."""
KINDS = {("32FC1", False): np.dtype("<f4"), ("32FC1", True): np.dtype(">f4")}
"""Numbers of heights, by the encoding and whether the first byte is the highest."""


def way_of(topic: str) -> str | None:
    """Return the direction that a topic of images shows, in any namespace; None of another."""
    return next((way for end, way in WAYS.items() if f"/{topic}".endswith(f"/{end}")), None)


def heights(message: Message) -> Array:
    """Return the heights (m) of an image, (lines, pixels); raises ValueError for another image."""
    kind = KINDS.get((message.encoding, bool(message.is_bigendian)))
    if kind is None:
        raise ValueError(f"its encoding is '{message.encoding}'")
    values = np.frombuffer(np.asarray(message.data).tobytes(), kind)
    return values.reshape(message.height, message.width).astype(np.float64)


def line_of(info: ScanInfo, message: Message) -> LineError:
    """Return the figures of a line from a ``TrackingError`` message."""
    first = round(1e-9 * (stamp_of(message) - info.start) / info.sample_period)
    rms, largest = (message.rms_x, message.rms_y), (message.max_x, message.max_y)
    return LineError(message.line, first, *rms, *largest)
