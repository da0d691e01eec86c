"""The ROS side of a driver that runs in a separate process."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NoReturn

import numpy as np

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.guarded import Displacement
from afm_scan_ros.drivers.link import ALIVE, DRIVE, ENDED, OPEN, START, STOP, Link, Message
from afm_scan_ros.drivers.settings import DriverChoice
from afm_scan_ros.files.records import to_mapping

SIGN_OF_LIFE = 0.05
"""Seconds between two signs of life, where no block says that the ROS side is there."""
OPENING = 60.0
"""Longest wait (s) for the process to begin."""
ENDING = 3.0
"""Longest wait (s) for the process to say that the outputs are at rest."""

_RUN = "import sys; from afm_scan_ros.drivers.process import main; main(int(sys.argv[1]))"


class DriverProcess:
    """A driver in its own process, which ramps down when this one is silent, stopped or ended.

    One request at a time, ``start`` or ``advance``, is ``waiting`` for its ``answer``. The driver's
    process has a session of its own: a signal to the group of this one does not reach it.
    ``silence`` (s) of this process ends in the ramp; ``patience`` (s) is how long an answer may
    take. ``knows_true`` says whether each answer has a noise-free displacement. After an error
    ``outcome`` says why, and whether the outputs are at rest.
    Raises InputError where the driver refuses its settings.
    """

    def __init__(self, choice: DriverChoice, silence: float, patience: float) -> None:
        self.outcome: str | None = None
        self._patience = patience
        self._asked = 0.0
        self.waiting = False
        self._block: Trace | None = None
        self._next_sign = 0.0
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-c", _RUN, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self._link = Link(ours)
        self._link.patience = ENDING
        try:
            self._open(choice, silence)
        except (InputError, ScanError):
            self.close()
            raise

    def start(self, sample_period: float) -> None:
        """Ask the driver to prepare for one sample period (s)."""
        self._request(Message(START, {"sample_period": sample_period}))

    def advance(self, drive: Trace, *, last: bool) -> None:
        """Ask the driver to output a block (V), the ``last`` of a scan or not."""
        self._block = drive
        asked = {
            "first_sample": drive.first_sample,
            "sample_period": drive.sample_period,
            "last": last,
        }
        self._request(Message(DRIVE, asked, np.stack([drive.x, drive.y])))

    def answer(self, wait: float) -> Displacement | None:
        """Return the displacement once it is there; None for none within ``wait`` s.

        It follows on the last answer, and may end before the block where the sensor is late.
        Raises ScanError, or InputError before any block, where the driver has ended, and ScanError
        where it takes too long.
        """
        if not self._link.readable(wait):
            if time.monotonic() - self._asked > self._patience:
                raise ScanError(f"the driver has not answered for {self._patience:g} s")
            return None
        message = self._take()
        self.waiting = False
        if (block := self._block) is None:
            return None
        first, rows = message.fields["first_sample"], iter(message.samples)
        pairs = zip(rows, rows, strict=True)
        return Displacement(*(Trace(first, block.sample_period, x, y) for x, y in pairs))

    def show_life(self) -> None:
        """Send the driver periodic signs of life; raises as ``answer`` does.

        A driver that is working reads no message, and its watchdog does not count.
        """
        if self.waiting or time.monotonic() < self._next_sign:
            return
        if self._link.readable(0.0):
            self._take()  # unasked, it only ever says that it has ended
        self._send(Message(ALIVE))

    def ramp_down(self, why: str) -> str:
        """Bring the outputs to rest, end the driver, and return why and how, within seconds.

        Where the driver has ended already, that is what is returned.
        """
        deadline = time.monotonic() + ENDING
        with suppress(InputError, ScanError):
            self._send(Message(STOP))
            while self._link.readable(max(0.0, deadline - time.monotonic())):
                self._take(why)
            self._end(f"{why}; the driver has not said that the drive is at rest")
        return str(self.outcome)

    def close(self) -> None:
        """Bring the outputs to rest, and wait for the process to end; it ends without this too."""
        self.ramp_down("closed")
        self._link.close()
        with suppress(subprocess.TimeoutExpired):  # then it still ramps, and is not to be killed
            self._process.wait(ENDING)

    def _open(self, choice: DriverChoice, silence: float) -> None:
        asked = {
            "driver": choice.driver,
            "settings": to_mapping(choice.settings),
            "options": choice.options,
            "where": choice.where,
            "silence": silence,
        }
        self._send(Message(OPEN, asked))
        if not self._link.readable(OPENING):
            raise ScanError(f"driver {choice.driver} did not open within {OPENING:g} s")
        self.knows_true: bool = self._take().fields["knows_true"]

    def _request(self, message: Message) -> None:
        self._send(message)
        self.waiting, self._asked = True, time.monotonic()

    def _send(self, message: Message) -> None:
        if self.outcome is not None:
            raise ScanError(self.outcome)
        try:
            self._link.send(message)
        except OSError:  # it has ended: what it said last tells why
            while True:
                self._take()
        self._next_sign = time.monotonic() + SIGN_OF_LIFE

    def _take(self, why: str = "closed") -> Message:
        """Return the next message; raises the error with which the driver has ended.

        ``why`` is the reason where it was asked to end.
        """
        if self.outcome is not None:
            raise ScanError(self.outcome)
        try:
            message = self._link.receive()
        except (EOFError, OSError):
            self._end(f"the driver's process {self._fate()}; the drive may not be at rest")
        if message.kind == ENDED:
            self._end_with(message.fields, why)
        return message

    def _end_with(self, said: Mapping[str, Any], why: str) -> NoReturn:
        """Raise the error in the driver's last message."""
        reason, ramp = said["why"] or why, said["ramp"]
        if said["bad_input"] and self._block is None:
            self.outcome = reason
            raise InputError(reason)
        if ramp is None:
            self._end(f"{reason}; the ramp-down failed: the drive may not be at rest")
        moved = f"; drive ramped down to 0 V within {ramp:.3g} s" if self._block else ""
        self._end(f"{reason}{moved}")

    def _end(self, outcome: str) -> NoReturn:
        self.outcome = outcome
        raise ScanError(outcome)

    def _fate(self) -> str:
        """Describe how the process that closed its end of the link has ended."""
        with suppress(subprocess.TimeoutExpired):
            status = self._process.wait(ENDING)
            return f"was killed by {signal.Signals(-status).name}" if status < 0 else "ended"
        return "hangs"
