"""DDS topics, writers and readers that carry serialised CDR instead of objects.

The binding would convert each message float by float; here a sample is a container of bytes.
"""

import ctypes
import os
from functools import cache
from typing import Any

from cyclonedds._clayer import ddspy_take
from cyclonedds.core import (
    DDSException,
    Entity,
    InstanceState,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.internal import dds_c_t, load_cyclonedds
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.util import duration
from rosbags.interfaces import Nodetype

from afm_scan_ros.ros.cyclone import HOLDS_LOCK
from afm_scan_ros.ros.cyclone.base import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    RCLError,
    ReliabilityPolicy,
)
from afm_scan_ros.ros.cyclone.message_types import TYPESTORE, Description

_idl: Any = types  # whose annotations do not say that array[float64, 3] is meant to be written

_prototype = ctypes.PYFUNCTYPE if HOLDS_LOCK in os.environ else ctypes.CFUNCTYPE
_dds_write = _prototype(ctypes.c_int32, ctypes.c_int32, ctypes.c_void_p)(
    ("dds_write", load_cyclonedds())
)

# What rmw_cyclonedds_cpp puts before a request's and a reply's own fields.
_CALL = {"client_guid": types.uint64, "sequence_number": types.int64}

_FOREVER: int = duration(infinite=True)

_ANY = SampleState.Any | ViewState.Any | InstanceState.Any

_BASE = {"bool": bool, "byte": types.byte, "char": types.uint8, "string": str}


def dds_qos(profile: QoSProfile, user_data: str) -> Qos:
    """Return the DDS policies of an endpoint, in XCDR1 as ROS 2 writes and reads it."""
    keep_all = profile.history == HistoryPolicy.KEEP_ALL
    history = Policy.History.KeepAll if keep_all else Policy.History.KeepLast(profile.depth)
    reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    policies = [
        history,
        Policy.Reliability.Reliable(_FOREVER) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(user_data.encode()),
    ]
    if latched:  # or a late reader gets the last sample only, whatever the depth
        policies.append(Policy.DurabilityService(0, history, -1, -1, -1))
    return Qos(*policies)


@cache
def envelope_class(name: str) -> type[IdlStruct]:
    """Envelope for messages of type ``package/msg/Name``, under ROS 2's DDS name for that type.

    It says truly what lies in the bytes: Cyclone DDS checks them against it.
    """
    made: type[IdlStruct] = _struct(name)
    return made


def _struct(name: str) -> Any:  # noqa: ANN401 - the binding's is untyped
    package, kind, short = name.split("/")
    members = {field: _member(described) for field, described in TYPESTORE.fielddefs[name][1]}
    if kind == "srv":
        members = {**_CALL, **members}
    dds_name = f"{package}.{kind}.dds_.{short}_"
    return make_idl_struct(short, dds_name, members, dataclassify=False)


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
    """A DDS entity with an explicit end; garbage collection would delay it for other processes."""

    def end(self) -> None:
        """Delete it, with everything that it owns."""
        self._delete(self._ref)


class OwnDomain(Ending, Domain):
    """A domain as this process has it configured."""


class Participant(Ending, DomainParticipant):
    """The process's part in a domain."""


class Reader(Ending, DataReader[IdlStruct]):
    """A reader of CDR."""

    def take_valid(self) -> bytes | None:
        """Next message, or None; samples that only announce a writer's end are skipped."""
        while taken := ddspy_take(self._ref, _ANY, 1):
            if isinstance(taken, int):
                raise DDSException(taken, f"while reading from {self.topic.name}")
            cdr, info = taken[0]
            if info.valid_data:
                return bytes(cdr)
        return None

    def writer_count(self) -> int:
        """Count the writers whose samples come here."""
        status = self.get_subscription_matched_status()  # type: ignore[no-untyped-call] # the binding's is untyped
        return int(status.current_count)

    def any_sample(self) -> ReadCondition:
        """Return the condition that holds while there is anything to take."""
        return ReadCondition(self, _ANY)


class Writer(Ending, DataWriter[IdlStruct]):
    """A writer of CDR during whose blocking the other threads run.

    DDS makes a writer wait while a reader lags too far behind. The binding's own ``write`` keeps
    the interpreter locked for so long.
    """

    def write_cdr(self, cdr: bytes) -> None:
        """Send one sample; raises RCLError."""
        padded = cdr.ljust(-4 * (-len(cdr) // 4), b"\0")
        result = _dds_write(self._ref, ctypes.byref(_Sample(padded, len(padded))))
        if result < 0:
            raise RCLError(str(DDSException(result, f"while writing to {self.topic.name}")))

    def reader_count(self) -> int:
        """Count the readers that get what is written."""
        # The list of them fails where one comes between its being sized and its being filled.
        status = self.get_publication_matched_status()  # type: ignore[no-untyped-call] # the binding's is untyped
        return int(status.current_count)


class Waits(WaitSet):
    """A waitset that returns which entities are ready; the binding's returns how many."""

    def add(self, entity: Entity, number: int) -> None:
        """Wait for an entity too, under a number of its own."""
        result = self._waitset_attach(self._ref, entity._ref, number)  # noqa: SLF001 - the binding's own way
        if result < 0:
            raise DDSException(result, f"while attaching {entity!r}")
        self.attached.append((entity, number))

    def there(self, nanoseconds: int) -> list[int]:
        """Return the numbers of the ready entities as soon as there is one, or none in time."""
        found = (dds_c_t.attach * len(self.attached))()
        result = self._waitset_wait(self._ref, found, len(found), nanoseconds)
        if result < 0:
            raise DDSException(result, "while waiting")
        return [number or 0 for number in found[:result]]
