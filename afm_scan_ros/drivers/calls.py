"""How long a call of a driver may take, what happens then, and the priority that it has."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock, Timer

from afm_scan_ros.core.errors import ScanError

PRIORITY = 10
"""Real-time priority, of 1 to 99: above all usual work, below the kernel's for devices, 50."""

_turn = Lock()


@contextmanager
def ending_after(seconds: float) -> Iterator[None]:
    """End this process by SIGALRM where the work takes longer.

    The kernel sends it, so that it also ends a call that keeps the interpreter locked.
    """
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def bounded(call: str, seconds: float, rest: float) -> Iterator[None]:
    """Raise ScanError where a call of the driver has returned late.

    One that has not returned ``rest`` s after its bound is taken to hang, and the process ends.
    """
    begun = time.monotonic()
    with ending_after(seconds + rest):
        yield
    if (taken := time.monotonic() - begun) > seconds:
        raise ScanError(f"{call} of the driver took {taken:.3g} s, and may take {seconds:.3g} s")


@contextmanager
def taken_over_after(seconds: float, take_over: Callable[[], None]) -> Iterator[None]:
    """Call ``take_over`` in another thread where the work takes longer; it ends the process.

    This thread then does nothing more after the work.
    """
    returned = False

    def late() -> None:
        with _turn:
            if not returned:
                take_over()

    timer = Timer(seconds, late)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        with _turn:
            returned = True


def take_priority() -> str:
    """Run this thread, and those that it starts, in real time where that is allowed; say so."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (AttributeError, OSError) as error:  # other systems have no such call
        return f"no real-time priority: {error}"
    return f"real-time priority {PRIORITY}"
