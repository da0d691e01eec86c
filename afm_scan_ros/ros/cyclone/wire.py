"""DDS topics, writers and readers that carry ready-made CDR in place of objects.

The binding would take each message apart float by float; here a sample is an envelope for bytes.
"""

import ctypes
from functools import cache
from typing import Any, Self

from cyclonedds.core import DDSException, Entity
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.internal import load_cyclonedds
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from rosbags.interfaces import Nodetype

from afm_scan_ros.ros.cyclone.message_types import TYPESTORE, Description

_idl: Any = types  # whose annotations do not say that array[float64, 3] is meant to be written

_dds_write = load_cyclonedds().dds_write
_dds_write.argtypes = (ctypes.c_int32, ctypes.c_void_p)
_dds_write.restype = ctypes.c_int32

# What rmw_cyclonedds_cpp puts before a request's and a reply's own fields.
_CALL = {"client_guid": types.uint64, "sequence_number": types.int64}

_BASE = {"bool": bool, "byte": types.byte, "char": types.uint8, "string": str}


class Envelope(IdlStruct):
    """A sample of some type, as the CDR that goes over the wire, its four-byte header included."""

    def __init__(self, cdr: bytes) -> None:
        self.cdr = cdr
        self.sample_info: Any = None  # the binding's, set when a sample is taken

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
    """Envelope for messages of type ``package/msg/Name``, under ROS 2's DDS name for that type.

    It says truly what lies in the bytes: Cyclone DDS checks them against it.
    """
    made: type[Envelope] = _struct(name, (Envelope,))
    return made


def _struct(name: str, bases: tuple[type[Envelope], ...] = ()) -> Any:  # noqa: ANN401 - of bases
    package, kind, short = name.split("/")
    members = {field: _member(described) for field, described in TYPESTORE.fielddefs[name][1]}
    if kind == "srv":
        members = {**_CALL, **members}
    dds_name = f"{package}.{kind}.dds_.{short}_"
    return make_idl_struct(short, dds_name, members, dataclassify=False, bases=bases)


def _member(described: Description) -> object:
    node, kind = described
    if node == Nodetype.NAME:
        return _struct(kind)
    if node == Nodetype.ARRAY:
        return _idl.array[_member(kind[0]), kind[1]]
    if node == Nodetype.SEQUENCE:
        return _idl.sequence[_member(kind[0])]
    name, bound = kind
    if bound:
        return _idl.bounded_str[bound]
    return _BASE.get(name) or getattr(types, name)


class _Sample(ctypes.Structure):
    """What the binding's serialiser takes for a sample: ``ddspy_sample_container_t``."""

    _fields_ = (("cdr", ctypes.c_char_p), ("size", ctypes.c_size_t))


class Ending(Entity):
    """A part of DDS that ends when told; garbage collection would let other processes wait."""

    def end(self) -> None:
        """Delete it, with everything that it owns."""
        self._delete(self._ref)


class Participant(Ending, DomainParticipant):
    """The process's part in a domain."""


class Reader(Ending, DataReader[Envelope]):
    """A reader of CDR."""

    def take_valid(self) -> Envelope | None:
        """Next sample, or None; samples that only tell of a writer's end are passed by."""
        while taken := self.take(N=1):
            if taken[0].sample_info.valid_data:
                return taken[0]
        return None


class Writer(Ending, DataWriter[Envelope]):
    """A writer of CDR during whose blocking the other threads run.

    DDS makes a writer wait while a reader lags too far behind. The binding's own ``write`` keeps
    the interpreter locked for so long, and with it the thread that must ramp a drive down.
    """

    def write_cdr(self, cdr: bytes) -> None:
        """Send one sample; raises DDSException."""
        padded = cdr.ljust(-4 * (-len(cdr) // 4), b"\0")
        result = _dds_write(self._ref, ctypes.byref(_Sample(padded, len(padded))))
        if result < 0:
            raise DDSException(result, f"while writing to {self.topic.name}")

    def wait_for_acknowledgements(self, nanoseconds: int) -> bool:
        """Tell whether all readers have acknowledged everything within that time."""
        result = self._wait_for_acks(self._ref, nanoseconds)
        if result not in (0, DDSException.DDS_RETCODE_TIMEOUT):
            raise DDSException(result, f"while waiting for the readers of {self.topic.name}")
        return bool(result == 0)
