"""Errors and records under rclpy's names."""

from enum import IntEnum
from typing import Protocol

from attrs import define, field, frozen

from afm_scan_ros.ros.cyclone.names import Arguments


class NotInitializedError(RuntimeError):
    """A node was made or spun before ``init`` or after ``shutdown``."""


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The domain was left while an executor was to wait."""


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """A node was asked for something after ``destroy_node``."""


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
