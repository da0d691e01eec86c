"""A node that another process started ends when that process is gone, however it went."""

import os
import signal
import threading

_INPUT = 0


def end_with_parent() -> None:
    """End this process, as SIGTERM does, when the pipe on its standard input closes.

    The parent holds the other end and writes nothing, so it closes with the parent alone.
    """
    threading.Thread(target=_await_end, daemon=True).start()


def _await_end() -> None:
    """Read past sys.stdin, whose lock a thread would still hold when the interpreter ends."""
    while os.read(_INPUT, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
