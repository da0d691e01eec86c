"""The DDS domain: how it is found, one participant for a process, and the endpoints of its nodes.

ROS 2's environment variables of discovery become three settings of Cyclone DDS, as in
``rmw_cyclonedds_cpp``. A domain on this machine alone also binds its sockets to the loopback
device. Otherwise Cyclone DDS sends through the given interface only, but receives and parses
packets at every address of the machine.
"""

import os
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

from attrs import define, field
from cyclonedds.core import DDSException, GuardCondition, Listener
from cyclonedds.internal import dds_c_t
from cyclonedds.qos import Policy, Qos
from cyclonedds.topic import Topic

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.ros.common import URI, Message, users_settings
from afm_scan_ros.ros.cyclone.base import Arguments, Joined, Logger, QoSProfile
from afm_scan_ros.ros.cyclone.message_types import type_hash
from afm_scan_ros.ros.cyclone.wire import (
    CdrReader,
    CdrWriter,
    Ending,
    EntityWaits,
    Graph,
    NodeEndpoints,
    OwnDomain,
    Participant,
    dds_qos,
    envelope_class,
)

_DEVICE = b"lo\0"
_OPEN = Path("/proc/self/fd")


@contextmanager
def kept_to_loopback() -> Iterator[None]:
    """Bind the sockets that are opened within to the loopback device; Linux from 5.7 on can."""
    before = _sockets()
    yield
    for descriptor in _sockets() - before:
        with socket.socket(fileno=os.dup(descriptor)) as opened:
            if opened.family in (socket.AF_INET, socket.AF_INET6):
                with suppress(PermissionError):  # Linux before 5.7 lets none but root
                    opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, _DEVICE)


def _sockets() -> set[int]:
    """Descriptors of the process that are sockets; none where there is no way to bind them."""
    if not hasattr(socket, "SO_BINDTODEVICE"):
        return set()
    return {int(each.name) for each in _OPEN.iterdir() if _is_socket(each)}


def _is_socket(descriptor: Path) -> bool:
    try:
        return str(descriptor.readlink()).startswith("socket:")
    except FileNotFoundError:  # the one that listed them
        return False


_SETTINGS = {
    "SYSTEM_DEFAULT": "",
    "SUBNET": "",
    "LOCALHOST": (
        '<General><Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/>'
        "</Interfaces><AllowMulticast>false</AllowMulticast></General>"
        "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        '<Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
    ),
    "OFF": (
        '<General><Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/>'
        "</Interfaces><AllowMulticast>false</AllowMulticast></General>"
        "<Discovery><ParticipantIndex>none</ParticipantIndex>"
        "<Tag>pid${CYCLONEDDS_PID}</Tag></Discovery>"
    ),
}


def domain_id(environment: Mapping[str, str] = os.environ) -> int:
    """Number of the DDS domain, from ROS_DOMAIN_ID; raises InputError if it is none."""
    text = environment.get("ROS_DOMAIN_ID") or "0"
    if not text.isdigit() or int(text) > 232:  # noqa: PLR2004 - the last whose ports exist
        raise InputError(f"ROS_DOMAIN_ID = {text!r}: give a whole number from 0 to 232")
    return int(text)


def stays_here(environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether discovery is limited to this host; a user's CYCLONEDDS_URI is not examined."""
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
    return reach in ("LOCALHOST", "OFF") and not users_settings(environment)


def configuration(environment: Mapping[str, str] = os.environ) -> str:
    """Return Cyclone DDS's configuration: ROS 2's discovery range, then CYCLONEDDS_URI.

    What the user wrote in CYCLONEDDS_URI comes last, so it wins. Raises InputError for a range
    that is none of ROS 2's.
    """
    if peers := environment.get("ROS_STATIC_PEERS"):
        raise InputError(
            f"ROS_STATIC_PEERS = {peers!r}: not supported; name peers by CYCLONEDDS_URI"
        )
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") or "SUBNET"
    if reach not in _SETTINGS:
        given = f"ROS_AUTOMATIC_DISCOVERY_RANGE = {reach!r}"
        raise InputError(f"{given}: give one of {', '.join(_SETTINGS)}")
    fragments = [
        f"<CycloneDDS><Domain>{_SETTINGS[reach]}</Domain></CycloneDDS>",
        environment.get(URI, ""),
    ]
    return ",".join(fragment for fragment in fragments if fragment)


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

    def reader(self, name: str, message: type[Message], qos: QoSProfile) -> CdrReader:
        """Make the reader of a topic."""
        warning = self._warning("on_requested_incompatible_qos", _NO_WRITER.format(_shown(name)))
        topic = Topic(self.participant, name, envelope_class(message.__msgtype__))
        made = CdrReader(self.participant, topic, _qos(qos, message), warning)
        self._made.append(made)
        self.graph.add_endpoint(self.shown.readers, made)
        return made

    def writer(self, name: str, message: type[Message], qos: QoSProfile) -> CdrWriter:
        """Make the writer of a topic."""
        warning = self._warning("on_offered_incompatible_qos", _NO_READER.format(_shown(name)))
        topic = Topic(self.participant, name, envelope_class(message.__msgtype__))
        made = CdrWriter(self.participant, topic, _qos(qos, message), warning)
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

    def waits(self) -> EntityWaits:
        """Return what an executor waits by."""
        return EntityWaits(self.participant)

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
