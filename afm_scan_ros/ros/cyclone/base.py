"""Errors, quality of service and log lines under rclpy's names."""

import sys
import time
from enum import IntEnum
from types import CodeType
from typing import Protocol

from attrs import define, field, frozen

from afm_scan_ros.ros.cyclone.names import Arguments


class NotInitializedError(RuntimeError):
    """A node was made or spun before ``init`` or after ``shutdown``."""


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The domain was left while an executor was to wait."""


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """A node was asked for something after ``destroy_node``."""


class RCLError(RuntimeError):
    """DDS did not take a message."""


class SignalHandlerOptions(IntEnum):
    """Which signals ``init`` takes over; here it takes none."""

    NO = 0


class Waker(Protocol):
    """Ends the wait of an executor."""

    def set(self, value: bool) -> object:  # noqa: FBT001 - the binding's
        """End it."""
        ...


@define(eq=False)
class Joined:
    """What a process has joined: the arguments of its nodes, and what wakes its executors."""

    arguments: Arguments
    wakers: list[Waker] = field(factory=list, init=False)

    def wake(self) -> None:
        """Let every executor look at what it waits for again."""
        for waker in self.wakers:
            waker.set(True)


@frozen
class TopicEndpointInfo:
    """A publisher or subscription, with what this package's nodes use of rclpy's record."""

    topic_type: str


class HistoryPolicy(IntEnum):
    """How many samples are kept; numbers as in rmw/types.h."""

    KEEP_LAST = 1
    KEEP_ALL = 2


class ReliabilityPolicy(IntEnum):
    """Whether a lost sample is sent again."""

    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(IntEnum):
    """Whether a reader that comes late still gets what was written."""

    TRANSIENT_LOCAL = 1
    VOLATILE = 2


@frozen(kw_only=True)
class QoSProfile:
    """Policies of one publisher or subscription; the defaults are ROS 2's.

    Raises ValueError for keep-last without a depth, as rclpy does.
    """

    history: HistoryPolicy = HistoryPolicy.KEEP_LAST
    depth: int = 0
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE

    def __attrs_post_init__(self) -> None:
        if self.history == HistoryPolicy.KEEP_LAST and self.depth < 1:
            raise ValueError("QoSProfile: history KEEP_LAST needs a depth of at least 1")


def profile_of(qos: QoSProfile | int) -> QoSProfile:
    """Return a profile where rclpy takes a profile or a depth."""
    return qos if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)


@frozen
class Logger:
    """Writes ``[LEVEL] [seconds] [name]: text``, as ROS 2's console output.

    Raises ValueError, as rclpy does, where one place in the code logs at a second severity.
    """

    name: str
    _severities: dict[tuple[CodeType, int], str] = field(factory=dict, init=False, eq=False)

    def info(self, message: str) -> None:
        """Say what happens."""
        self._write("INFO", message)

    def warning(self, message: str) -> None:
        """Say what is not as it should be, and goes on."""
        self._write("WARN", message)

    def error(self, message: str) -> None:
        """Say what ends the work."""
        self._write("ERROR", message)

    def _write(self, level: str, message: str) -> None:
        caller = sys._getframe(2)  # noqa: SLF001 - the place that logs, as rclpy tells them apart
        if self._severities.setdefault((caller.f_code, caller.f_lasti), level) != level:
            raise ValueError("Logger severity cannot be changed between calls.")
        line = f"[{level}] [{time.time():.9f}] [{self.name}]: {message}\n"
        sys.stderr.write(line)
        sys.stderr.flush()
