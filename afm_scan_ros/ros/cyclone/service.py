"""Services and their clients under rclpy's names.

In ``rmw_cyclonedds_cpp`` a request and its reply begin with who asked and the how-manieth request
it is; the definitions in ``message_types`` have these two as their first fields.
"""

import secrets
import time
from collections.abc import Callable
from functools import partial

from attrs import Factory, define, field
from cyclonedds.core import ReadCondition
from cyclonedds.sub import DataReader

from afm_scan_ros.ros.cyclone.endpoints import any_sample
from afm_scan_ros.ros.cyclone.message_types import (
    deserialize_message,
    message_class,
    serialize_message,
)
from afm_scan_ros.ros.cyclone.qos import QoSProfile
from afm_scan_ros.ros.cyclone.wire import Envelope, Writer, take_valid
from afm_scan_ros.ros.typing import Message

SERVICE_QOS = QoSProfile(depth=10)
_POLL = 0.01


class Trigger:
    """``std_srvs/srv/Trigger``."""

    Request = message_class("std_srvs/srv/Trigger_Request")
    Response = message_class("std_srvs/srv/Trigger_Response")


@define(eq=False)
class Service:
    """Answers requests by ``callback(request, response) -> response``."""

    srv_type: type[Trigger]
    callback: Callable[[Message, Message], Message]
    reader: DataReader[Envelope]
    writer: Writer
    condition: ReadCondition = field(init=False)

    def __attrs_post_init__(self) -> None:
        self.condition = any_sample(self.reader)

    def take(self) -> Callable[[], object] | None:
        """Return the answering of the next request, or None if there is none."""
        sample = take_valid(self.reader)
        return None if sample is None else partial(self._answer, sample.cdr)

    def _answer(self, cdr: bytes) -> None:
        request = deserialize_message(cdr, self.srv_type.Request)
        response = self.callback(request, self.srv_type.Response())
        response.client_guid = request.client_guid
        response.sequence_number = request.sequence_number
        self.writer.write_cdr(serialize_message(response))


@define(eq=False)
class Future:
    """What a call will have returned, once an executor has got it."""

    _results: list[Message] = Factory(list)

    def done(self) -> bool:
        """Tell whether the response is there."""
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

    srv_type: type[Trigger]
    reader: DataReader[Envelope]
    writer: Writer
    condition: ReadCondition = field(init=False)
    _guid: int = field(init=False, factory=lambda: secrets.randbits(64))
    _pending: dict[int, Future] = field(init=False, factory=dict)
    _sent: int = field(init=False, default=0)

    def __attrs_post_init__(self) -> None:
        self.condition = any_sample(self.reader)

    def service_is_ready(self) -> bool:
        """Tell whether a server is there that hears and can answer."""
        return bool(self.writer.matched_sub and self.reader.matched_pub)

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Tell whether a server is there within that time; None waits for ever."""
        end = None if timeout_sec is None else time.monotonic() + timeout_sec
        while not self.service_is_ready():
            if end is not None and time.monotonic() >= end:
                return False
            time.sleep(_POLL)
        return True

    def call_async(self, request: Message) -> Future:
        """Send a request; the future is done once an executor has taken the response."""
        self._sent += 1
        request.client_guid, request.sequence_number = self._guid, self._sent
        self._pending[self._sent] = Future()
        self.writer.write_cdr(serialize_message(request))
        return self._pending[self._sent]

    def take(self) -> Callable[[], object] | None:
        """Return the taking of the next response, or None if there is none for this client."""
        while (sample := take_valid(self.reader)) is not None:
            response = deserialize_message(sample.cdr, self.srv_type.Response)
            if response.client_guid == self._guid:
                return partial(self._finish, response)
        return None

    def _finish(self, response: Message) -> None:
        self._pending.pop(response.sequence_number).set_result(response)
