"""The ROS graph: announces our nodes to ``ros2 node list`` and ``info``, and reads others."""

from collections.abc import Iterable
from threading import Lock
from typing import Any
from uuid import UUID

from attrs import Factory, define, field
from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopic,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import Entity, InstanceState
from cyclonedds.topic import Topic

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.base import DurabilityPolicy, HistoryPolicy, QoSProfile
from afm_scan_ros.ros.cyclone.message_types import (
    deserialize_message,
    message_class,
    serialize_message,
)
from afm_scan_ros.ros.cyclone.wire import Participant, Reader, Writer, dds_qos, envelope_class

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
    _writer: Writer = field(init=False)
    _reader: Reader = field(init=False)
    all_writers: Census = field(init=False)
    all_readers: Census = field(init=False)
    _nodes: list[NodeEndpoints] = Factory(list)
    _others: dict[bytes, list[Message]] = Factory(dict)
    _lock: Lock = Factory(Lock)

    def __attrs_post_init__(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        topic = Topic(self.participant, "ros_discovery_info", envelope_class(_INFO))
        self._writer = Writer(self.participant, topic, dds_qos(latched, ""))
        self._reader = Reader(self.participant, topic, dds_qos(_EVERYONES, ""))
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
