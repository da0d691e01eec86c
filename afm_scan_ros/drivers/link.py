"""The link between the ROS process and the driver's process, and how long each side waits.

A message is two lengths, a header in JSON, and rows of float64 samples as they lie in memory.
It goes over a pair of sockets.
"""

import json
import select
import socket
import struct
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.drivers import ScannerSettings

OPEN, START, DRIVE, ALIVE, STOP = "open", "start", "drive", "alive", "stop"
"""What the ROS process asks for, or, with ALIVE, that it is there."""
OPENED, STARTED, MOVED, ENDED = "opened", "started", "moved", "ended"
"""What the driver's process answers; ENDED is its last message, when the outputs are at rest."""

_LENGTHS = struct.Struct("=IIQ")  # of the header in bytes, rows, samples in a row


@frozen(eq=False)
class Message:
    """A kind, values that JSON can hold, and samples of shape (rows, n)."""

    kind: str
    fields: Mapping[str, Any] = field(factory=dict)
    samples: Array = field(factory=lambda: np.empty((0, 0)))


class Link:
    """One end of the link. ``patience`` (s) bounds each wait; None waits without limit."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._arrivals = select.poll()
        self._arrivals.register(end, select.POLLIN)

    @property
    def patience(self) -> float | None:
        """Longest wait (s) for the other end to send or to receive."""
        return self._socket.gettimeout()

    @patience.setter
    def patience(self, seconds: float | None) -> None:
        self._socket.settimeout(seconds)

    def readable(self, wait: float) -> bool:
        """Return whether a message, or the end of them, is there within ``wait`` s."""
        return bool(self._arrivals.poll(1e3 * wait))

    def send(self, message: Message) -> None:
        """Send a message; raises TimeoutError, or OSError where the other end is gone."""
        header = json.dumps({"kind": message.kind, **message.fields}).encode()
        lengths = _LENGTHS.pack(len(header), *message.samples.shape)
        self._socket.sendall(b"".join((lengths, header, message.samples.tobytes())))

    def receive(self) -> Message:
        """Return the next message; raises TimeoutError, or EOFError where the other end is gone."""
        header_length, rows, count = _LENGTHS.unpack(self._exactly(_LENGTHS.size))
        fields = json.loads(self._exactly(header_length))
        samples = np.frombuffer(self._exactly(8 * rows * count)).reshape(rows, count)
        return Message(fields.pop("kind"), fields, samples)

    def deafen(self) -> None:
        """Make every further ``receive`` return the end; safe in a signal handler."""
        with suppress(OSError):  # it is closed already
            self._socket.shutdown(socket.SHUT_RD)

    def close(self) -> None:
        """Close this end; the other end notices."""
        self._socket.close()

    def _exactly(self, size: int) -> bytearray:
        data = bytearray(size)
        left = memoryview(data)
        while left:
            received = self._socket.recv_into(left)
            if not received:
                raise EOFError("the other end of the link is closed")
            left = left[received:]
        return data


ENDING = 3.0
"""Longest time (s), beside the ramp itself, for the outputs to be at rest."""


@frozen
class DriverTimeouts:
    """Longest waits (s).

    After ``silence`` of the ROS side the outputs ramp down. ``opening`` bounds the driver's
    constructor, and its ``start``. An answer to a block may come ``answer`` after the block and its
    readings are due. A driver that takes longer hangs, and its process ends.
    """

    silence: float
    opening: float
    answer: float

    def for_answer(self, block: Trace, latency_samples: int) -> float:
        """Longest time (s) that the driver may take for a block, with its late readings."""
        return (block.x.size + latency_samples) * block.sample_period + self.answer


def ramp_bound(settings: ScannerSettings, late: float) -> float:
    """Longest time (s) that a ramp to rest may take, from any drive within the limits.

    Before it the driver outputs what is in its buffer, whose readings come ``late`` (s): twice
    that at most.
    """
    return settings.amplifier.longest_ramp + 2.0 * late + ENDING


def late(seconds: float) -> str:
    """Say that the driver has taken longer than it may (s)."""
    return f"the driver has not answered for {seconds:.3g} s"
