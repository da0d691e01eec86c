"""Clocks, durations and timers under rclpy's names."""

import time
from collections.abc import Callable
from enum import IntEnum

from attrs import define, field, frozen

NANOSECONDS = 1_000_000_000


class ClockType(IntEnum):
    """Numbers as in rcl/time.h. ROS time without simulated time is the system's."""

    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


@frozen
class Instant:
    """A time, in nanoseconds of the clock that gave it."""

    nanoseconds: int


@frozen(kw_only=True)
class Clock:
    """A source of time."""

    clock_type: ClockType = ClockType.SYSTEM_TIME

    def now(self) -> Instant:
        """Return the time of this clock."""
        steady = self.clock_type == ClockType.STEADY_TIME
        return Instant(time.monotonic_ns() if steady else time.time_ns())


@frozen(init=False)
class Duration:
    """A span of time; negative means without end where a timeout is asked for."""

    nanoseconds: int

    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        self.__attrs_init__(round(seconds * NANOSECONDS) + nanoseconds)


@define(eq=False)
class Timer:
    """Calls back once a period; periods that were missed are left out, as in rcl."""

    period: int
    callback: Callable[[], object]
    clock: Clock
    _due: int = field(init=False)
    _cancelled: bool = field(init=False, default=False)

    def __attrs_post_init__(self) -> None:
        self.reset()

    def cancel(self) -> None:
        """Stop calling back."""
        self._cancelled = True

    def reset(self) -> None:
        """Start a new period now."""
        self._cancelled = False
        self._due = self.clock.now().nanoseconds + self.period

    def time_until_next_call(self) -> int | None:
        """Nanoseconds left, not positive if it is due; None once cancelled."""
        return None if self._cancelled else self._due - self.clock.now().nanoseconds

    def take(self) -> Callable[[], object] | None:
        """Return the callback if it is due, counting this period as called."""
        left = self.time_until_next_call()
        if left is None or left > 0:
            return None
        self._due += (-left // self.period + 1) * self.period
        return self.callback
