"""The link between the ROS process and the driver's process, and how long each side waits.

A message is two lengths, a header in JSON, and rows of float64 samples, one after the other.
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
from afm_scan_ros.drivers.safety import SafetySettings

OPEN, START, DRIVE, ALIVE, STOP = "open", "start", "drive", "alive", "stop"
"""What the ROS process asks for, or, with ALIVE, that it is there."""
OPENED, STARTED, MOVED, ENDED = "opened", "started", "moved", "ended"
"""What the driver's process answers; ENDED is its last message, when the outputs are at rest."""

_LENGTHS = struct.Struct("=IIQ")  # of the header in bytes, rows, samples in a row


@frozen(eq=False)
class Message:
    """A kind, values that JSON can hold, and real numbers of shape (rows, n), sent as float64."""

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
        """Send a message.

        Raises TimeoutError, OSError where the other end is gone, and TypeError or ValueError for
        samples that are no real numbers in rows, of which nothing is sent.
        """
        samples = message.samples.astype(np.float64, casting="same_kind", copy=False)
        rows, count = samples.shape
        header = json.dumps({"kind": message.kind, **message.fields}).encode()
        lengths = _LENGTHS.pack(len(header), rows, count)
        self._socket.sendall(b"".join((lengths, header, samples.tobytes())))

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


@frozen
class DriverTimeouts:
    """Longest waits (s), and whether a scan runs in ``real_time``, so that its driver has priority.

    The outputs ramp down after ``silence`` of the ROS side, and, from the first block to the last,
    where no more drive has come for ``starved`` since the last block would have been output: signs
    of life do not count. ``opening`` bounds the driver's constructor, and its ``start``, which set
    up hardware. An answer to a block may come ``answer`` after the block and its readings are due.
    ``rest`` is what may pass beside the ramp itself until the outputs are at rest, and
    ``sign_of_life`` the time between two signs of the ROS side.

    In real time the outputs are to be at rest within 0.5 s of a fault. The longest ramp of the
    amplifier's settings, as 0.125 s from 5 V at 40 V/s, and some 0.05 s for the process to run
    leave 0.3 s for ``silence``, ``starved`` and ``answer``. A driver's buffer bridges what is
    shorter than itself. One longer than the waits does not lengthen them: the drive in it is output
    before the ramp, and rest would come later still. Where a scan does not run in real time, the
    outputs wait for computations, and the waits are those of a process that hangs.
    """

    silence: float
    starved: float
    opening: float
    answer: float
    real_time: bool
    rest: float = SafetySettings().rest
    sign_of_life: float = SafetySettings().sign_of_life

    def for_answer(self, block: Trace, latency_samples: int) -> float:
        """Longest time (s) that the driver may take for a block, with its late readings."""
        return (block.x.size + latency_samples) * block.sample_period + self.answer


def ramp_bound(settings: ScannerSettings, late: float, rest: float) -> float:
    """Longest time (s) that a ramp to rest may take, from any drive within the limits.

    Before it the driver outputs what is in its buffer, whose readings come ``late`` (s): twice
    that at most. ``rest`` (s) is what the process may take beside that.
    """
    return settings.amplifier.longest_ramp + 2.0 * late + rest


def late(seconds: float) -> str:
    """Say that the driver has taken longer than it may (s)."""
    return f"the driver has not answered for {seconds:.3g} s"
