"""Clears what Fast DDS processes that were killed left in shared memory.

Who opens a port's file waits without end while it is empty or its first word does not say that it
is initialised (Boost.Interprocess, which Fast DDS 2.14 uses). A process that is killed in between
leaves such a file, and every later participant that opens it hangs. A participant's segment stays
too, and holds its memory; its lock file is locked for as long as the participant lives.
"""

import fcntl
import os
import re
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

MEMORY = Path("/dev/shm")  # noqa: S108 - where glibc has shared memory

STARTING = 1.0
"""Seconds that a living process may take to initialise a file: microseconds, and its turns."""

_PORT = re.compile(r"fastrtps_port\d+")
_SEGMENT_LOCK = re.compile(r"fastrtps_[0-9a-f]{16}_el")
_WORD = 4
_NOT_INITIALISED = (b"\0\0\0\0", b"\1\0\0\0")
"""The first word before a file is initialised, and while it is."""


def clear(memory: Path = MEMORY) -> list[str]:
    """Remove what no living process has open; say what was removed, and what would hang others."""
    if not memory.is_dir():
        return []
    with _alone(memory):
        names = sorted(path.name for path in memory.iterdir())
        ports = [memory / name for name in names if _PORT.fullmatch(name)]
        said = [sentence for port in ports if (sentence := _clear_port(port))]
        locks = [memory / name for name in names if _SEGMENT_LOCK.fullmatch(name)]
        freed = [size for lock in locks if (size := _clear_segment(lock)) is not None]
    if freed:
        megabytes = f"{sum(freed) / 1e6:.0f} MB"
        said.append(f"removed {len(freed)} segments ({megabytes}) of killed processes in {memory}")
    return said


def hangs(port: Path) -> bool:
    """Return whether a process that opens the file of a port waits without end."""
    try:
        with port.open("rb") as file:
            word = file.read(_WORD)
    except OSError:
        return False  # gone, or as closed to Fast DDS as it is to us
    return not word or word in _NOT_INITIALISED


@contextmanager
def _alone(memory: Path) -> Iterator[None]:
    """Wait until no other node clears: two would take each other for living owners."""
    folder = os.open(memory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def _clear_port(port: Path) -> str:
    """Remove the file of a port where it hangs who opens it; say so, or why it was kept."""
    what = f"{port} is not initialised, so that every process on Fast DDS that opens it hangs"
    deadline = time.monotonic() + STARTING
    while hangs(port):
        try:
            with port.open("rb") as file:
                _lease(file.fileno())
                port.unlink()
        except FileNotFoundError:
            return ""
        except BlockingIOError:
            if time.monotonic() > deadline:
                return f"{what}; end the processes that 'fuser {port}' names, then rm {port}"
            time.sleep(STARTING / 20)
        except OSError as error:
            return f"{what}, and cannot be removed ({error.strerror}): sudo rm {port}"
        else:
            with suppress(OSError):
                port.with_name(f"sem.{port.name}_mutex").unlink()
            return f"{what}: removed, since a process that was killed as it started had left it"
    return ""


def _lease(descriptor: int) -> None:
    """Raise BlockingIOError where anybody else has the file open or mapped, in any container.

    The kernel grants a write lease to the only one that has a file open; who opens it meanwhile
    waits, and the holder gets a signal. SIGURG does nothing by itself, SIGIO would end the process.
    """
    fcntl.fcntl(descriptor, fcntl.F_SETSIG, signal.SIGURG)
    fcntl.fcntl(descriptor, fcntl.F_SETLEASE, fcntl.F_WRLCK)


def _clear_segment(lock: Path) -> int | None:
    """Remove a segment and its lock file; return its size (B), or None where it is kept.

    Whoever makes a segment locks the file first, and takes another name where that fails.
    """
    segment = lock.with_name(lock.name.removesuffix("_el"))
    with suppress(OSError), lock.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # raises where its process lives
        size = segment.stat().st_size if segment.exists() else 0
        segment.unlink(missing_ok=True)
        lock.unlink()
        return size
    return None
