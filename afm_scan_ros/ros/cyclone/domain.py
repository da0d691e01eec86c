"""The DDS domain: one participant for a process, and the endpoints of its nodes."""

from contextlib import nullcontext

from attrs import define, field
from cyclonedds.core import DDSException, GuardCondition, Listener
from cyclonedds.internal import dds_c_t
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.base import Joined, Logger, QoSProfile
from afm_scan_ros.ros.cyclone.discovery import (
    configuration,
    domain_id,
    kept_to_loopback,
    stays_here,
)
from afm_scan_ros.ros.cyclone.graph import Graph, NodeEndpoints
from afm_scan_ros.ros.cyclone.message_types import type_hash
from afm_scan_ros.ros.cyclone.names import Arguments
from afm_scan_ros.ros.cyclone.wire import (
    Ending,
    OwnDomain,
    Participant,
    Reader,
    Waits,
    Writer,
    dds_qos,
    envelope_class,
)

# Those of dds_public_qosdefs.h on which a reader and a writer can disagree.
_POLICIES = {2: "DURABILITY", 4: "DEADLINE", 8: "LIVELINESS", 11: "RELIABILITY", 23: "XCDR"}
_NO_READER = (
    "New subscription discovered on topic '{}', requesting incompatible QoS."
    " No messages will be sent to it."
)
_NO_WRITER = (
    "New publisher discovered on topic '{}', offering incompatible QoS."
    " No messages will be received from it."
)


@define(eq=False)
class Entities:
    """The DDS readers and writers of one node; a topic's name begins with ROS 2's ``rt/``."""

    participant: Participant
    graph: Graph
    shown: NodeEndpoints
    logger: Logger
    _made: list[Ending] = field(factory=list)

    def reader(self, name: str, message: type[Message], qos: QoSProfile) -> Reader:
        """Make the reader of a topic."""
        warning = self._warning("on_requested_incompatible_qos", _NO_WRITER.format(_shown(name)))
        topic = Topic(self.participant, name, envelope_class(message.__msgtype__))
        made = Reader(self.participant, topic, _qos(qos, message), warning)
        self._made.append(made)
        self.graph.add_endpoint(self.shown.readers, made)
        return made

    def writer(self, name: str, message: type[Message], qos: QoSProfile) -> Writer:
        """Make the writer of a topic."""
        warning = self._warning("on_offered_incompatible_qos", _NO_READER.format(_shown(name)))
        topic = Topic(self.participant, name, envelope_class(message.__msgtype__))
        made = Writer(self.participant, topic, _qos(qos, message), warning)
        self._made.append(made)
        self.graph.add_endpoint(self.shown.writers, made)
        return made

    def end(self) -> None:
        """Take all of them out of the graph."""
        self.graph.remove(self.shown)
        for each in self._made:
            each.end()

    def _warning(self, event: str, seen: str) -> Listener:
        def warn(_: object, status: dds_c_t.offered_incompatible_qos_status) -> None:
            policy = _POLICIES.get(status.last_policy_id, status.last_policy_id)
            text = f"{seen} Last incompatible policy: {policy}"
            self.logger.warning(text)

        return Listener(**{event: warn})  # type: ignore[no-untyped-call] # the binding's is untyped


def _shown(name: str) -> str:
    """Return a topic's name as rclpy shows it in a warning: without its first slash."""
    return name.removeprefix("rt/")


def _qos(profile: QoSProfile, message: type[Message]) -> Qos:
    return dds_qos(profile, f"typehash={type_hash(message)};")


@define(eq=False)
class Context(Joined):
    """What ``init`` makes and ``shutdown`` ends."""

    domain: OwnDomain
    participant: Participant
    graph: Graph
    logger: type[Logger] = Logger

    def entities(self, namespace: str, name: str, logger: Logger) -> Entities:
        """Show a node to the others, and return what makes its readers and writers."""
        shown = NodeEndpoints(namespace, name)
        self.graph.add(shown)
        return Entities(self.participant, self.graph, shown, logger)

    def writer_types(self, topic: str) -> list[str]:
        """Types of the writers of a DDS topic in all processes, one for each."""
        return self.graph.all_writers.types(topic)

    def reader_types(self, topic: str) -> list[str]:
        """Types of the readers of a DDS topic in all processes, one for each."""
        return self.graph.all_readers.types(topic)

    def node_names(self) -> list[str]:
        """Names of the nodes of all processes."""
        return self.graph.node_names()

    def waits(self) -> Waits:
        """Return what an executor waits by."""
        return Waits(self.participant)

    def waker(self) -> GuardCondition:
        """Return what ends its waits."""
        return GuardCondition(self.participant)

    def end(self) -> None:
        """Leave the domain."""
        self.wake()
        self.participant.end()
        self.domain.end()  # the next may have other settings


def join(arguments: Arguments) -> Context:
    """Join the domain that the environment names; raises InputError where that is not possible."""
    number = domain_id()
    try:
        with kept_to_loopback() if stays_here() else nullcontext():
            domain = OwnDomain(number, configuration())
            participant = Participant(number, Qos(Policy.Userdata(b"enclave=/;")))
    except DDSException as error:
        raise InputError(
            f"ROS_DOMAIN_ID = {number}: the domain cannot be joined; check CYCLONEDDS_URI, and that"
            " fewer than 33 processes are in a domain of range LOCALHOST"
        ) from error
    return Context(arguments, domain, participant, Graph(participant))
