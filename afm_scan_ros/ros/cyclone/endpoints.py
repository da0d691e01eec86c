"""Publishers, subscriptions, services and their clients under rclpy's names.

As in ``rmw_cyclonedds_cpp``, who asked and the number of the request stand between a request's CDR
header and its fields; the reply gives both back.
"""

import secrets
import struct
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from attrs import Factory, define, field

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.base import QoSProfile
from afm_scan_ros.ros.cyclone.message_types import (
    ServiceType,
    deserialize_message,
    serialize_message,
)

_CDR_HEADER = 4
_CALL = struct.Struct("<Qq")  # the client's id, the request's number
_BODY = _CDR_HEADER + _CALL.size
_POLL = 0.01

SERVICE_QOS = QoSProfile(depth=10)


class Reader(Protocol):
    """Receives the CDR of a topic's messages."""

    def take_valid(self) -> bytes | None:
        """Return the next message, or None."""
        ...

    def writer_count(self) -> int:
        """Count the writers whose messages come here."""
        ...

    def any_sample(self) -> Any:  # noqa: ANN401 - each backend's own
        """Return the condition that an executor waits for."""
        ...


class Writer(Protocol):
    """Sends the CDR of a topic's messages."""

    def write_cdr(self, cdr: bytes) -> None:
        """Send one message."""
        ...

    def reader_count(self) -> int:
        """Count the readers that get what is written."""
        ...


class Readable(Protocol):
    """What an executor waits for: a subscription, a service or a client."""

    reader: Reader

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
        return self.writer.reader_count()


@define(eq=False)
class Subscription:
    """Calls back with each message, or with its bytes if ``raw``."""

    msg_type: type[Message]
    topic_name: str
    callback: Callable[[Message], object]
    raw: bool
    reader: Reader

    def take(self) -> Callable[[], object] | None:
        """Return what is to be done with the next message, or None if there is none."""
        cdr = self.reader.take_valid()
        return None if cdr is None else partial(self._call, cdr)

    def _call(self, cdr: bytes) -> None:
        self.callback(cdr if self.raw else deserialize_message(cdr, self.msg_type))


@define(eq=False)
class Service:
    """Answers requests by ``callback(request, response) -> response``."""

    srv_type: type[ServiceType]
    callback: Callable[[Message, Message], Message]
    reader: Reader
    writer: Writer

    def take(self) -> Callable[[], object] | None:
        """Return the answering of the next request, or None if there is none."""
        cdr = self.reader.take_valid()
        return None if cdr is None else partial(self._answer, cdr)

    def _answer(self, cdr: bytes) -> None:
        call, request = _unpacked(cdr, self.srv_type.Request)
        response = self.callback(request, self.srv_type.Response())
        self.writer.write_cdr(_packed(call, response))


@define(eq=False)
class Future:
    """The response to a call, available once an executor has received it."""

    _results: list[Message] = Factory(list)

    def done(self) -> bool:
        """Return whether the response is there."""
        return bool(self._results)

    def result(self) -> Message | None:
        """Return the response, or None before it is there."""
        return self._results[0] if self._results else None

    def set_result(self, result: Message) -> None:
        """Give the response."""
        self._results.append(result)


@define(eq=False)
class Client:
    """Calls a service."""

    srv_type: type[ServiceType]
    reader: Reader
    writer: Writer
    _id: int = field(init=False, factory=lambda: secrets.randbits(64))
    _pending: dict[int, Future] = field(init=False, factory=dict)
    _sent: int = field(init=False, default=0)

    def service_is_ready(self) -> bool:
        """Return whether a server is there that hears and can answer."""
        return bool(self.writer.reader_count() and self.reader.writer_count())

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Return whether a server is there within that time; None waits for ever."""
        end = None if timeout_sec is None else time.monotonic() + timeout_sec
        while not self.service_is_ready():
            if end is not None and time.monotonic() >= end:
                return False
            time.sleep(_POLL)
        return True

    def call_async(self, request: Message) -> Future:
        """Send a request; the future is done once an executor has taken the response."""
        self._sent += 1
        self._pending[self._sent] = Future()
        self.writer.write_cdr(_packed(_CALL.pack(self._id, self._sent), request))
        return self._pending[self._sent]

    def take(self) -> Callable[[], object] | None:
        """Return the taking of the next response, or None if there is none for this client."""
        while (cdr := self.reader.take_valid()) is not None:
            call, response = _unpacked(cdr, self.srv_type.Response)
            asked_by, number = _CALL.unpack(call)
            if asked_by == self._id:
                return partial(self._pending.pop(number).set_result, response)
        return None


def _packed(call: bytes, message: Message) -> bytes:
    cdr = serialize_message(message)
    return cdr[:_CDR_HEADER] + call + cdr[_CDR_HEADER:]


def _unpacked(cdr: bytes, message_type: type[Message]) -> tuple[bytes, Message]:
    message = deserialize_message(cdr[:_CDR_HEADER] + cdr[_BODY:], message_type)
    return cdr[_CDR_HEADER:_BODY], message
