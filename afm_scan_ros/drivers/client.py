"""The ROS side of a driver that runs in a separate process."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import IO, Any, NoReturn, Self

import numpy as np
from attrs import asdict

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import DriverChoice, link
from afm_scan_ros.drivers.guarded import Displacement
from afm_scan_ros.files.records import to_mapping

_RUN = "import sys; from afm_scan_ros.drivers.process import main; main(int(sys.argv[1]))"


class DriverProcess:
    """A driver in its own process, which ramps down when this one is silent, stopped or ended.

    One request at a time, ``start`` or ``advance``, is ``waiting`` for its ``answer``. ``start``
    may be asked for at once; ``opened`` waits for what the driver says of its settings before.
    The driver's process has a session of its own: a signal to the group of this one does not reach
    it. It writes to ``output``, by default where this one does. ``latency_samples`` is, once it has
    started, how much later than its displacement it reads, and ``priority`` whether its process has
    real-time priority, or why not. After an error ``outcome`` says why, and whether the outputs are
    at rest.
    """

    def __init__(
        self, choice: DriverChoice, waits: link.DriverTimeouts, output: IO[str] | None = None
    ) -> None:
        self.outcome: str | None = None
        self._waits, self._settings = waits, choice.settings
        self._asked = self._allowed = self._period = 0.0
        self._at_rest = True
        self.latency_samples, self.priority = 0, ""
        self.waiting = False
        self._block: Trace | None = None
        self._next_sign = 0.0
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-P", "-c", _RUN, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self._link = link.Link(ours)
        self._link.patience = self._waits.rest
        self._ask_to_open(choice)

    def opened(self) -> Self:
        """Wait until the driver has opened; ``knows_true`` then says whether it knows that signal.

        Raises InputError where the driver refuses its settings.
        """
        if not self._link.readable(self._waits.opening):
            self.close()
            raise ScanError(f"the driver did not open within {self._waits.opening:g} s")
        try:
            self.knows_true: bool = self._take().fields["knows_true"]
        except (InputError, ScanError):
            self.close()
            raise
        return self

    def start(self, sample_period: float) -> None:
        """Ask the driver to prepare for one sample period (s)."""
        self._period = sample_period
        self._request(
            link.Message(link.START, {"sample_period": sample_period}), self._waits.opening
        )

    def advance(self, drive: Trace, *, last: bool) -> None:
        """Ask the driver to output a block (V), the ``last`` of a scan or not."""
        self._block, self._at_rest = drive, False
        asked = {
            "first_sample": drive.first_sample,
            "sample_period": drive.sample_period,
            "last": last,
        }
        allowed = self._waits.for_answer(drive, self.latency_samples)
        self._request(link.Message(link.DRIVE, asked, np.stack([drive.x, drive.y])), allowed)

    def answer(self, wait: float) -> Displacement | None:
        """Return the displacement once it is there; None for none within ``wait`` s.

        It follows on the last answer, and may end before the block where the sensor is late.
        Raises ScanError, or InputError before any block, where the driver has ended, and ScanError
        where it takes too long.
        """
        if not self._link.readable(wait):
            if time.monotonic() - self._asked > self._allowed:
                raise ScanError(link.late(self._allowed))
            return None
        message = self._take()
        if message.kind == link.OPENED:
            return None
        self.waiting = False
        if (block := self._block) is None:
            self.latency_samples = message.fields["latency_samples"]
            self.priority = message.fields["priority"]
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
        self._send(link.Message(link.ALIVE))

    def ramp_down(self, why: str) -> str:
        """Bring the outputs to rest, end the driver, and return why and how, within seconds.

        A block that is late may be answered within ``rest``, and the ramp begins then. Where the
        driver has ended already, that is what is returned.
        """
        latency = self.latency_samples * self._period
        return_of_block = self._waits.rest if self.waiting and self._block else 0.0
        ramp = link.ramp_bound(self._settings, latency, self._waits.rest)
        deadline = time.monotonic() + return_of_block + ramp
        with suppress(InputError, ScanError):
            self._send(link.Message(link.STOP))
            while self._link.readable(max(0.0, deadline - time.monotonic())):
                self._take(why)
            self._end(f"{why}; the driver has not said that the drive is at rest")
        return str(self.outcome)

    def close(self) -> str:
        """Bring the outputs to rest, and end the process, by force where it hangs.

        Return why they may not be at rest, nothing where they are.
        """
        outcome = self.ramp_down("the scan has ended")
        self._link.close()
        try:
            self._process.wait(self._waits.rest)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        return "" if self._at_rest else outcome

    def _ask_to_open(self, choice: DriverChoice) -> None:
        asked = {
            "driver": choice.driver,
            "settings": to_mapping(choice.settings),
            "options": choice.options,
            "where": choice.where,
            "waits": asdict(self._waits),
        }
        try:
            self._send(link.Message(link.OPEN, asked))
        except (InputError, ScanError):
            self.close()
            raise

    def _request(self, message: link.Message, allowed: float) -> None:
        self._send(message)
        self.waiting, self._asked, self._allowed = True, time.monotonic(), allowed

    def _send(self, message: link.Message) -> None:
        if self.outcome is not None:
            raise ScanError(self.outcome)
        try:
            self._link.send(message)
        except OSError:  # it has ended: what it said last tells why
            while True:
                self._take()
        self._next_sign = time.monotonic() + self._waits.sign_of_life

    def _take(self, why: str = "") -> link.Message:
        """Return the next message; raises the error with which the driver has ended.

        ``why`` is the reason where it was asked to end.
        """
        if self.outcome is not None:
            raise ScanError(self.outcome)
        try:
            message = self._link.receive()
        except (EOFError, OSError):
            asked = f"{why}; " if why else ""
            at_rest = "; the drive may not be at rest" if self._block else ""
            self._end(f"{asked}{self._fate()}{at_rest}")
        if message.kind == link.ENDED:
            self._end_with(message.fields, why)
        return message

    def _end_with(self, said: Mapping[str, Any], why: str) -> NoReturn:
        """Raise the error in the driver's last message."""
        reason, ramp = said["why"] or why, said["ramp"]
        if said["bad_input"] and self._block is None:
            self.outcome = reason
            raise InputError(reason)
        if isinstance(ramp, str):
            self._at_rest = False
            self._end(f"{reason}; {ramp}: the drive may not be at rest")
        self._at_rest = True
        moved = f"; drive ramped down to 0 V within {ramp:.3g} s" if self._block else ""
        self._end(f"{reason}{moved}")

    def _end(self, outcome: str) -> NoReturn:
        self.outcome = outcome
        raise ScanError(outcome)

    def _fate(self) -> str:
        """Describe how the process that closed its end of the link has ended."""
        try:
            status = -self._process.wait(self._waits.rest)
        except subprocess.TimeoutExpired:
            return "the driver's process hangs"
        if status == signal.SIGALRM:
            return "a call of the driver did not return in time, and its process was ended"
        killed = f"was killed by {signal.Signals(status).name}" if status > 0 else "ended"
        return f"the driver's process {killed}"
