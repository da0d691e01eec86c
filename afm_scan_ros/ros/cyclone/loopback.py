"""Keeps the middleware's sockets on the loopback device, so that no other host's packet gets in.

Cyclone DDS sends through the one interface that it is given, but receives at every address of the
machine, where it refuses what comes from elsewhere only after taking it apart.
"""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_DEVICE = b"lo\0"
_OPEN = Path("/proc/self/fd")


@contextmanager
def kept_to_loopback() -> Iterator[None]:
    """Bind the sockets that are opened within to the loopback device; Linux from 5.7 on can."""
    before = _sockets()
    yield
    for descriptor in _sockets() - before:
        with socket.socket(fileno=os.dup(descriptor)) as opened:
            if opened.family in (socket.AF_INET, socket.AF_INET6):
                with suppress(PermissionError):  # Linux before 5.7 lets none but root
                    opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, _DEVICE)


def _sockets() -> set[int]:
    """Descriptors of the process that are sockets; none where there is no way to bind them."""
    if not hasattr(socket, "SO_BINDTODEVICE"):
        return set()
    return {int(each.name) for each in _OPEN.iterdir() if _is_socket(each)}


def _is_socket(descriptor: Path) -> bool:
    try:
        return str(descriptor.readlink()).startswith("socket:")
    except FileNotFoundError:  # the one that listed them
        return False
