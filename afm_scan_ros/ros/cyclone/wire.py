"""DDS topics, writers and readers that carry ready-made CDR in place of objects.

The binding would take each message apart float by float; here a sample is an envelope for bytes.
"""

import ctypes
from functools import cache
from typing import Any, Self

from cyclonedds.core import DDSException
from cyclonedds.idl import IdlStruct, types
from cyclonedds.internal import c_call, dds_c_t
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from rosbags.interfaces import Nodetype

from afm_scan_ros.ros.cyclone.message_types import TYPESTORE

_BASE = {"bool": bool, "byte": types.byte, "char": types.uint8, "string": str}


class Envelope(IdlStruct):
    """A sample of some type, as the CDR that goes over the wire, its four-byte header included."""

    def __init__(self, cdr: bytes) -> None:
        self.cdr = cdr
        self.sample_info: Any = None

    @classmethod
    def deserialize(cls, data: bytes, *_: object, **__: object) -> Self:
        """Take the bytes as they came."""
        return cls(data)

    @classmethod
    def deserialize_key(cls, data: bytes, *_: object, **__: object) -> Self:
        """Take the bytes that came when a writer left; there is no message in them."""
        return cls(data)


@cache
def envelope_class(name: str) -> type[Envelope]:
    """Envelope for messages of type ``package/msg/Name``, under ROS 2's DDS name for that type."""
    return _struct(name, Envelope)


@cache
def _struct(name: str, base: type[Any] = IdlStruct) -> Any:
    package, kind, short = name.split("/")
    dds_name = f"{package}.{kind}.dds_.{short}_"
    members = {field: _member(*described) for field, described in TYPESTORE.fielddefs[name][1]}
    body = {"__annotations__": members}
    namespace = type(IdlStruct).__prepare__(short, (base,), typename=dds_name)
    namespace["__annotations__"].update(body["__annotations__"])
    return type(IdlStruct)(short, (base,), namespace)


def _member(node: Nodetype, kind: Any) -> Any:
    if node == Nodetype.NAME:
        return _struct(kind)
    if node == Nodetype.ARRAY:
        return types.array[_member(*kind[0]), kind[1]]
    if node == Nodetype.SEQUENCE:
        return types.sequence[_member(*kind[0])]
    name, bound = kind
    if bound:
        return types.bounded_str[bound]
    return _BASE.get(name) or getattr(types, name)


class _Sample(ctypes.Structure):
    """What the binding's serialiser takes for a sample: ``ddspy_sample_container_t``."""

    _fields_ = (("cdr", ctypes.c_char_p), ("size", ctypes.c_size_t))


class Writer(DataWriter):  # type: ignore[misc, type-arg]
    """A writer of CDR during whose blocking the other threads run.

    DDS makes a writer wait while a reader lags too far behind. The binding's own ``write`` keeps
    the interpreter locked for so long, and with it the thread that must ramp a drive down.
    """

    def write_cdr(self, cdr: bytes) -> None:
        """Send one sample; raises DDSException."""
        padded = cdr.ljust(-4 * (-len(cdr) // 4), b"\0")
        result = self._dds_write(self._ref, ctypes.byref(_Sample(padded, len(padded))))
        if result < 0:
            raise DDSException(result, f"while writing to {self.topic.name}")

    def wait_for_acknowledgements(self, nanoseconds: int) -> bool:
        """Tell whether all readers have acknowledged everything within that time."""
        result = self._wait_for_acks(self._ref, nanoseconds)
        if result not in (0, DDSException.DDS_RETCODE_TIMEOUT):
            raise DDSException(result, f"while waiting for the readers of {self.topic.name}")
        return bool(result == 0)

    @c_call("dds_write")
    def _dds_write(self, writer: dds_c_t.entity, sample: ctypes.c_void_p) -> dds_c_t.returnv:
        pass


def take_valid(reader: "DataReader[Envelope]") -> Envelope | None:
    """Next sample of a reader, or None; samples that only tell of a writer's end are passed by."""
    while taken := reader.take(N=1):
        if taken[0].sample_info.valid_data:
            return taken[0]
    return None
