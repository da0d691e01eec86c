"""The rclpy replacement without DDS: the nodes of one process, in one thread.

Messages are serialised to CDR, as over DDS, so that nodes compute the same results. No other
process is reached, so services are not offered.
"""

import sys
from collections import deque
from collections.abc import Callable, Sequence

from attrs import define, field

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.base import (
    NamedNode,
    NotInitializedError,
    SignalHandlerOptions,
    TopicEndpointInfo,
)
from afm_scan_ros.ros.cyclone.log import Logger
from afm_scan_ros.ros.cyclone.message_types import deserialize_message, serialize_message
from afm_scan_ros.ros.cyclone.messages import Trigger
from afm_scan_ros.ros.cyclone.names import Arguments, parse_arguments
from afm_scan_ros.ros.cyclone.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, profile_of


@define(eq=False)
class Subscription:
    """Keeps what was published until its callback is called with it, or with its bytes if raw."""

    msg_type: type[Message]
    topic_name: str
    qos_profile: QoSProfile
    callback: Callable[[Message], object]
    raw: bool
    waiting: deque[bytes] = field(init=False)

    def __attrs_post_init__(self) -> None:
        self.waiting = deque(maxlen=_depth(self.qos_profile))

    def call(self) -> None:
        """Call back with the next message."""
        cdr = self.waiting.popleft()
        self.callback(cdr if self.raw else deserialize_message(cdr, self.msg_type))


@define(eq=False)
class Publisher:
    """Sends messages of one type on one topic; a latched one keeps its last ones for later."""

    msg_type: type[Message]
    topic_name: str
    qos_profile: QoSProfile
    context: "Context"
    kept: deque[bytes] = field(init=False)

    def __attrs_post_init__(self) -> None:
        latched = self.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self.kept = deque(maxlen=_depth(self.qos_profile) if latched else 0)

    def publish(self, msg: Message) -> None:
        """Send a message; raises TypeError for one of another type."""
        if not isinstance(msg, self.msg_type):
            raise TypeError(f"{self.topic_name} takes {self.msg_type}, got {type(msg)}")
        cdr = serialize_message(msg)
        self.kept.append(cdr)
        for subscription in self.context.readers_of(self.topic_name):
            subscription.waiting.append(cdr)

    def get_subscription_count(self) -> int:
        """Count the readers that get what is published."""
        return len(self.context.readers_of(self.topic_name))


@define(eq=False)
class Context:
    """All endpoints of the process, and the arguments of the node that is made next."""

    arguments: Arguments
    publishers: list[Publisher] = field(factory=list)
    subscriptions: list[Subscription] = field(factory=list)

    def readers_of(self, topic: str) -> list[Subscription]:
        """Return the subscriptions to a topic."""
        return [each for each in self.subscriptions if each.topic_name == topic]

    def writers_of(self, topic: str) -> list[Publisher]:
        """Return the publishers of a topic."""
        return [each for each in self.publishers if each.topic_name == topic]


_current: list[Context] = []


def init(
    *,
    args: Sequence[str] | None = None,
    signal_handler_options: SignalHandlerOptions = SignalHandlerOptions.NO,  # noqa: ARG001 - rclpy's
) -> None:
    """Begin, with the ROS arguments of ``args`` (``sys.argv`` if None).

    Raises RuntimeError if that is done already, InputError for arguments that do not hold.
    """
    if _current:
        raise RuntimeError("init was called twice without a shutdown between")
    _current.append(Context(parse_arguments(sys.argv if args is None else args)))


def use_arguments(words: Sequence[str]) -> None:
    """Take the ROS arguments of a command line for the nodes that are made from now on."""
    current_context().arguments = parse_arguments(words)


def ok() -> bool:
    """Return whether ``init`` was called, and not ``shutdown`` after it."""
    return bool(_current)


def shutdown() -> None:
    """End; raises NotInitializedError where nothing began."""
    current_context()
    _current.clear()


def try_shutdown() -> None:
    """End if ``init`` was called."""
    _current.clear()


def current_context() -> Context:
    """Return what ``init`` made; raises NotInitializedError before it and after shutdown."""
    if not _current:
        raise NotInitializedError("call init first")
    return _current[0]


class Unheard(Logger):
    """Writes nothing: the command reports errors, as it does for nodes in other processes."""

    def _write(self, level: str, message: str) -> None:
        """Leave it."""


class Node(NamedNode):
    """A named owner of publishers and subscriptions."""

    def __init__(self, node_name: str) -> None:
        self._context = current_context()
        super().__init__(node_name, self._context.arguments)
        self._logger = Unheard(self._logger.name)
        self.publishers: list[Publisher] = []
        self.subscriptions: list[Subscription] = []

    def create_publisher(
        self, msg_type: type[Message], topic: str, qos_profile: QoSProfile | int
    ) -> Publisher:
        """Make a publisher of a topic."""
        name, qos = self.resolve_topic_name(topic), profile_of(qos_profile)
        publisher = Publisher(msg_type, name, qos, self._context)
        self.publishers.append(publisher)
        self._context.publishers.append(publisher)
        return publisher

    def create_subscription(
        self,
        msg_type: type[Message],
        topic: str,
        callback: Callable[[Message], object],
        qos_profile: QoSProfile | int,
        *,
        raw: bool = False,
    ) -> Subscription:
        """Subscribe to a topic; the last messages of its latched publishers are queued."""
        name, qos = self.resolve_topic_name(topic), profile_of(qos_profile)
        subscription = Subscription(msg_type, name, qos, callback, raw)
        if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            for publisher in self._context.writers_of(name):
                subscription.waiting.extend(publisher.kept)
        self.subscriptions.append(subscription)
        self._context.subscriptions.append(subscription)
        return subscription

    def create_service(
        self,
        srv_type: type[Trigger],
        srv_name: str,
        callback: Callable[[Message, Message], Message],
    ) -> None:
        """Accept a service without offering it, because no other process can call it."""

    def count_publishers(self, topic_name: str) -> int:
        """Count the publishers of a topic; the name is not remapped."""
        return len(self._context.writers_of(self.expanded(topic_name)))

    def get_publishers_info_by_topic(self, topic_name: str) -> list[TopicEndpointInfo]:
        """Return what is known of each publisher of a topic; the name is not remapped."""
        writers = self._context.writers_of(self.expanded(topic_name))
        return [TopicEndpointInfo(each.msg_type.__msgtype__) for each in writers]

    def destroy_node(self) -> None:
        """Take the node's endpoints away; it calls back no longer."""
        self._destroyed = True
        for publisher in self.publishers:
            self._context.publishers.remove(publisher)
        for subscription in self.subscriptions:
            self._context.subscriptions.remove(subscription)
        self.publishers.clear()
        self.subscriptions.clear()


@define(eq=False)
class SingleThreadedExecutor:
    """Calls back for its nodes, one message of each subscription in turn."""

    _nodes: list[Node] = field(factory=list)
    _turns: deque[Subscription] = field(factory=deque)

    def add_node(self, node: Node) -> bool:
        """Call back for this node too; return whether it is new here."""
        if node in self._nodes:
            return False
        self._nodes.append(node)
        return True

    def remove_node(self, node: Node) -> None:
        """Call back for this node no longer."""
        self._nodes.remove(node)
        self._turns.clear()

    def has_work(self) -> bool:
        """Return whether a message waits."""
        return any(each.waiting for node in self._nodes for each in node.subscriptions)

    def spin_once(self, timeout_sec: float | None = None) -> None:  # noqa: ARG002 - rclpy's
        """Call back once if a message waits; none can come while this thread would wait for it."""
        if not any(each.waiting for each in self._turns):
            self._turns.clear()
            self._turns.extend(each for node in self._nodes for each in node.subscriptions)
        while self._turns:
            subscription = self._turns.popleft()
            if subscription.waiting:
                subscription.call()
                return

    def shutdown(self) -> None:
        """Let go of all nodes."""
        self._nodes.clear()
        self._turns.clear()


def _depth(qos: QoSProfile) -> int | None:
    return None if qos.history == HistoryPolicy.KEEP_ALL else qos.depth
