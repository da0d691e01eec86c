"""Publishers and subscriptions under rclpy's names."""

from collections.abc import Callable
from functools import partial
from typing import Any

from attrs import define, field
from cyclonedds.core import InstanceState, Listener, ReadCondition, SampleState, ViewState
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from afm_scan_ros.ros.cyclone.clock import Duration
from afm_scan_ros.ros.cyclone.log import Logger
from afm_scan_ros.ros.cyclone.message_types import (
    deserialize_message,
    serialize_message,
    type_hash,
)
from afm_scan_ros.ros.cyclone.qos import QoSProfile, dds_qos
from afm_scan_ros.ros.cyclone.wire import Envelope, Writer, envelope_class, take_valid

ANY_SAMPLE = SampleState.Any | ViewState.Any | InstanceState.Any
_FOREVER = 2**63 - 1

# Those of dds_public_qosdefs.h on which a reader and a writer can disagree.
_POLICIES = {2: "DURABILITY", 4: "DEADLINE", 8: "LIVELINESS", 11: "RELIABILITY", 23: "XCDR"}


@define(eq=False)
class Publisher:
    """Sends messages of one type on one topic."""

    msg_type: type[Any]
    topic_name: str
    qos_profile: QoSProfile
    writer: Writer

    def publish(self, msg: Any) -> None:
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
        return len(self.writer.get_matched_subscriptions())

    def wait_for_all_acked(self, timeout: Duration = Duration(seconds=-1)) -> bool:  # noqa: B008 - frozen, and rclpy's default
        """Tell whether all readers acknowledged everything in time; negative waits for ever."""
        limit = timeout.nanoseconds if timeout.nanoseconds >= 0 else _FOREVER
        return self.writer.wait_for_acknowledgements(limit)


@define(eq=False)
class Subscription:
    """Calls back with each message, or with its bytes if ``raw``."""

    msg_type: type[Any]
    topic_name: str
    callback: Callable[[Any], object]
    raw: bool
    reader: "DataReader[Envelope]"
    condition: ReadCondition = field(init=False)

    def __attrs_post_init__(self) -> None:
        self.condition = ReadCondition(self.reader, ANY_SAMPLE)

    def take(self) -> Callable[[], object] | None:
        """Return what is to be done with the next message, or None if there is none."""
        sample = take_valid(self.reader)
        return None if sample is None else partial(self._call, sample.cdr)

    def _call(self, cdr: bytes) -> None:
        self.callback(cdr if self.raw else deserialize_message(cdr, self.msg_type))


def make_writer(
    participant: DomainParticipant, name: str, message: type[Any], qos: QoSProfile, logger: Logger
) -> Writer:
    """Make the DDS writer of a topic; ``name`` begins with ROS 2's prefix, as ``rt/``."""

    def warn(_: Writer, status: Any) -> None:
        logger.warning(
            f"New subscription discovered on topic '{name[2:]}', requesting incompatible QoS. No"
            f" messages will be sent to it. Last incompatible policy: {_policy(status)}"
        )

    topic = Topic(participant, name, envelope_class(message.__msgtype__))
    listener = Listener(on_offered_incompatible_qos=warn)
    return Writer(participant, topic, dds_qos(qos, _user_data(message)), listener)


def make_reader(
    participant: DomainParticipant, name: str, message: type[Any], qos: QoSProfile, logger: Logger
) -> "DataReader[Envelope]":
    """Make the DDS reader of a topic; ``name`` begins with ROS 2's prefix, as ``rt/``."""

    def warn(_: object, status: Any) -> None:
        logger.warning(
            f"New publisher discovered on topic '{name[2:]}', offering incompatible QoS. No"
            f" messages will be received from it. Last incompatible policy: {_policy(status)}"
        )

    topic = Topic(participant, name, envelope_class(message.__msgtype__))
    listener = Listener(on_requested_incompatible_qos=warn)
    return DataReader(participant, topic, dds_qos(qos, _user_data(message)), listener)


def _user_data(message: type[Any]) -> str:
    return f"typehash={type_hash(message)};"


def _policy(status: Any) -> str:
    return _POLICIES.get(status.last_policy_id, str(status.last_policy_id))
