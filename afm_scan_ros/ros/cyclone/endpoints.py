"""Publishers and subscriptions under rclpy's names."""

from collections.abc import Callable
from functools import partial
from typing import Protocol

from attrs import define, field
from cyclonedds.core import Listener, ReadCondition
from cyclonedds.internal import dds_c_t
from cyclonedds.topic import Topic

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.clock import Duration
from afm_scan_ros.ros.cyclone.log import Logger
from afm_scan_ros.ros.cyclone.message_types import deserialize_message, serialize_message, type_hash
from afm_scan_ros.ros.cyclone.qos import QoSProfile
from afm_scan_ros.ros.cyclone.wire import Participant, Reader, Writer, dds_qos, envelope_class

_FOREVER = 2**63 - 1
_FOR_EVER = Duration(seconds=-1)

# Those of dds_public_qosdefs.h on which a reader and a writer can disagree.
_POLICIES = {2: "DURABILITY", 4: "DEADLINE", 8: "LIVELINESS", 11: "RELIABILITY", 23: "XCDR"}


class Readable(Protocol):
    """What an executor waits for: a subscription, a service or a client."""

    condition: ReadCondition

    def take(self) -> Callable[[], object] | None:
        """Return what is to be done next, or None."""
        ...


@define(eq=False)
class Publisher:
    """Sends messages of one type on one topic."""

    msg_type: type[Message]
    topic_name: str
    qos_profile: QoSProfile
    writer: Writer

    def publish(self, msg: Message) -> None:
        """Send a message, or the bytes of one. It blocks while a reader lags far behind.

        Raises TypeError for a message of another type.
        """
        if isinstance(msg, bytes):
            self.writer.write_cdr(msg)
        elif isinstance(msg, self.msg_type):
            self.writer.write_cdr(serialize_message(msg))
        else:
            raise TypeError(f"{self.topic_name} takes {self.msg_type}, got {type(msg)}")

    def get_subscription_count(self) -> int:
        """Count the readers that get what is published."""
        # The list of them fails where one comes between its being sized and its being filled.
        status = self.writer.get_publication_matched_status()  # type: ignore[no-untyped-call] # the binding's is untyped
        return int(status.current_count)

    def wait_for_all_acked(self, timeout: Duration = _FOR_EVER) -> bool:
        """Return whether all readers acknowledged everything in time; negative waits for ever."""
        limit = timeout.nanoseconds if timeout.nanoseconds >= 0 else _FOREVER
        return self.writer.wait_for_acknowledgements(limit)


@define(eq=False)
class Subscription:
    """Calls back with each message, or with its bytes if ``raw``."""

    msg_type: type[Message]
    topic_name: str
    callback: Callable[[Message], object]
    raw: bool
    reader: Reader
    condition: ReadCondition = field(init=False)

    def __attrs_post_init__(self) -> None:
        self.condition = self.reader.any_sample()

    def take(self) -> Callable[[], object] | None:
        """Return what is to be done with the next message, or None if there is none."""
        cdr = self.reader.take_valid()
        return None if cdr is None else partial(self._call, cdr)

    def _call(self, cdr: bytes) -> None:
        self.callback(cdr if self.raw else deserialize_message(cdr, self.msg_type))


def make_writer(
    participant: Participant, name: str, message: type[Message], qos: QoSProfile, logger: Logger
) -> Writer:
    """Make the DDS writer of a topic; ``name`` begins with ROS 2's prefix, as ``rt/``."""
    seen = (
        f"New subscription discovered on topic '{name[2:]}', requesting incompatible QoS."
        " No messages will be sent to it."
    )
    topic = Topic(participant, name, envelope_class(message.__msgtype__))
    listener = _mismatch("on_offered_incompatible_qos", seen, logger)
    return Writer(participant, topic, dds_qos(qos, _user_data(message)), listener)


def make_reader(
    participant: Participant, name: str, message: type[Message], qos: QoSProfile, logger: Logger
) -> Reader:
    """Make the DDS reader of a topic; ``name`` begins with ROS 2's prefix, as ``rt/``."""
    seen = (
        f"New publisher discovered on topic '{name[2:]}', offering incompatible QoS."
        " No messages will be received from it."
    )
    topic = Topic(participant, name, envelope_class(message.__msgtype__))
    listener = _mismatch("on_requested_incompatible_qos", seen, logger)
    return Reader(participant, topic, dds_qos(qos, _user_data(message)), listener)


def _user_data(message: type[Message]) -> str:
    return f"typehash={type_hash(message)};"


def _mismatch(event: str, seen: str, logger: Logger) -> Listener:
    def warn(_: object, status: dds_c_t.offered_incompatible_qos_status) -> None:
        policy = _POLICIES.get(status.last_policy_id, status.last_policy_id)
        text = f"{seen} Last incompatible policy: {policy}"
        logger.warning(text)

    return Listener(**{event: warn})  # type: ignore[no-untyped-call] # the binding's is untyped
