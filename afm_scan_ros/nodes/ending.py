"""Ends a process that may hang or crash while it leaves ROS, with the status that it has."""

import ctypes
import signal

SIGEV_THREAD = 2
"""Of ``sigevent(3type)``: a thread that is made when the time is over calls a function."""

CRASHES = (signal.SIGABRT, signal.SIGBUS, signal.SIGSEGV)


class _Event(ctypes.Structure):
    """A ``struct sigevent`` of glibc."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attribute", ctypes.c_void_p),
        ("rest", ctypes.c_char * 32),
    )


class _Times(ctypes.Structure):
    """A ``struct itimerspec``: seconds and nanoseconds of the interval, and of the first time."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("every_s", "every_ns", "s", "ns"))


def end_within(seconds: int, status: int) -> None:
    """End the process with a status after so long, if it has not ended; also where it crashes.

    Fast DDS 2.14 waits without end where a participant is destroyed in the moment in which it is
    told that another one leaves (``DomainParticipant::set_listener`` against
    ``onWriterDiscovery``), as at the end of a scan. rclpy keeps the interpreter's lock meanwhile,
    so that no thread of Python could end the process. It may also abort there: a thread that
    crashes waits until the time is over, for what the node had to do is done.
    """
    libc = ctypes.CDLL(None)
    leave = ctypes.cast(libc._exit, ctypes.c_void_p)  # noqa: SLF001 - its name in C
    event = _Event(value=status, notify=SIGEV_THREAD, function=leave)
    timer = ctypes.c_void_p()
    libc.signal.argtypes = [ctypes.c_int, ctypes.c_void_p]
    for crash in CRASHES:
        libc.signal(crash, ctypes.cast(libc.pause, ctypes.c_void_p))
    libc.timer_create(1, ctypes.byref(event), ctypes.byref(timer))  # 1: the monotonic clock
    libc.timer_settime(timer, 0, ctypes.byref(_Times(0, 0, seconds, 0)), None)
