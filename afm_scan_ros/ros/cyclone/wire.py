"""DDS topics, writers and readers that carry serialised CDR, and the ROS graph that they form.

The binding would convert each message float by float; here a sample is a container of bytes.
The graph announces our nodes to ``ros2 node list`` and ``info``, and reads others.
"""

import ctypes
import os
from collections.abc import Iterable
from functools import cache
from threading import Lock
from typing import Any
from uuid import UUID

from attrs import Factory, define, field
from cyclonedds._clayer import ddspy_take
from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopic,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
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
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from rosbags.interfaces import Nodetype

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone import HOLDS_LOCK
from afm_scan_ros.ros.cyclone.base import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    RCLError,
    ReliabilityPolicy,
)
from afm_scan_ros.ros.cyclone.message_types import (
    TYPESTORE,
    Description,
    deserialize_message,
    message_class,
    serialize_message,
)

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


class CdrReader(Ending, DataReader[IdlStruct]):
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


class CdrWriter(Ending, DataWriter[IdlStruct]):
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


class EntityWaits(WaitSet):
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


_PACKAGE = "rmw_dds_common/msg"
_INFO = f"{_PACKAGE}/ParticipantEntitiesInfo"
_EVERYONES = QoSProfile(history=HistoryPolicy.KEEP_ALL, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_AT_ONCE = 100  # changes that are taken: the binding first makes room for as many


@define(eq=False)
class Census:
    """The DDS endpoints of one sort that are alive in all processes, by topic.

    It reads only changes, because the binding needs a millisecond for every few endpoints and a
    scan has a hundred.
    """

    participant: Participant
    sort: BuiltinTopic
    _news: BuiltinDataReader = field(init=False)
    _alive: dict[UUID, tuple[str, str]] = Factory(dict)
    _lock: Lock = Factory(Lock)

    def __attrs_post_init__(self) -> None:
        self._news = BuiltinDataReader(self.participant, self.sort)

    def types(self, topic: str) -> list[str]:
        """Types of a DDS topic's endpoints, one for each, as ``package/msg/Name``."""
        with self._lock:
            while news := self._news.take(N=_AT_ONCE):
                self._note(news)
            return [_ros_type(kind) for name, kind in self._alive.values() if name == topic]

    def alive(self) -> set[UUID]:
        """Ids of all endpoints."""
        self.types("")
        return set(self._alive)

    def _note(self, news: Iterable[Any]) -> None:
        for endpoint in news:
            if endpoint.sample_info.instance_state == InstanceState.Alive:
                self._alive[endpoint.key] = (endpoint.topic_name, endpoint.type_name)
            else:
                self._alive.pop(endpoint.key, None)


@define
class NodeEndpoints:
    """One node with the ids of its DDS readers and writers."""

    namespace: str
    name: str
    readers: list[UUID] = Factory(list)
    writers: list[UUID] = Factory(list)


@define(eq=False)
class Graph:
    """Keeps one sample of ``ros_discovery_info`` up to date, and reads what others say there."""

    participant: Participant
    _writer: CdrWriter = field(init=False)
    _reader: CdrReader = field(init=False)
    all_writers: Census = field(init=False)
    all_readers: Census = field(init=False)
    _nodes: list[NodeEndpoints] = Factory(list)
    _others: dict[bytes, list[Message]] = Factory(dict)
    _lock: Lock = Factory(Lock)

    def __attrs_post_init__(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        topic = Topic(self.participant, "ros_discovery_info", envelope_class(_INFO))
        self._writer = CdrWriter(self.participant, topic, dds_qos(latched, ""))
        self._reader = CdrReader(self.participant, topic, dds_qos(_EVERYONES, ""))
        self.all_writers = Census(self.participant, BuiltinTopicDcpsPublication)
        self.all_readers = Census(self.participant, BuiltinTopicDcpsSubscription)

    def add(self, node: NodeEndpoints) -> None:
        """Show a node."""
        with self._lock:
            self._nodes.append(node)
            self._write()

    def remove(self, node: NodeEndpoints) -> None:
        """Show a node no longer."""
        with self._lock:
            self._nodes.remove(node)
            self._write()

    def node_names(self) -> list[str]:
        """Names of the nodes of all processes that have a living writer."""
        with self._lock:
            while (cdr := self._reader.take_valid()) is not None:
                said = deserialize_message(cdr, message_class(_INFO))
                self._others[bytes(said.gid.data)] = said.node_entities_info_seq
            alive = {id_.bytes for id_ in self.all_writers.alive()}
            return [
                node.node_name
                for nodes in self._others.values()
                for node in nodes
                if any(bytes(writer.data) in alive for writer in node.writer_gid_seq)
            ]

    def add_endpoint(self, ids: list[UUID], endpoint: Entity) -> None:
        """Show one more reader or writer of a node: in its ``readers`` or ``writers``."""
        with self._lock:
            ids.append(endpoint.guid)
            self._write()

    def _write(self) -> None:
        message = message_class(_INFO)(
            gid=_gid(self.participant.guid),
            node_entities_info_seq=[_described(node) for node in self._nodes],
        )
        self._writer.write_cdr(serialize_message(message))


def _ros_type(dds_type: str) -> str:
    """Return ``package/msg/Name`` for ``package::msg::dds_::Name_``, and others as they are."""
    package, _, name = dds_type.partition("::msg::dds_::")
    return f"{package}/msg/{name.removesuffix('_')}" if name else dds_type


def _described(node: NodeEndpoints) -> Message:
    return message_class(f"{_PACKAGE}/NodeEntitiesInfo")(
        node_namespace=node.namespace,
        node_name=node.name,
        reader_gid_seq=[_gid(reader) for reader in node.readers],
        writer_gid_seq=[_gid(writer) for writer in node.writers],
    )


def _gid(guid: UUID) -> Message:
    return message_class(f"{_PACKAGE}/Gid")(data=list(guid.bytes))
