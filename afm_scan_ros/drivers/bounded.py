"""The bound on each call of a driver: a process whose driver hangs ends."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock, Timer

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
