"""The driver process: it owns the outputs, and a watchdog that ramps them down.

It uses neither ROS nor DDS, so a call that blocks there does not affect it. The watchdog is a
timeout on the next message, from the first block of drive on. The computing time of the driver does
not count.
"""

import signal
import socket
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np
from attrs import define

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers.guarded import GuardedDriver
from afm_scan_ros.drivers.link import (
    DRIVE,
    ENDED,
    MOVED,
    OPENED,
    START,
    STARTED,
    STOP,
    Link,
    Message,
)
from afm_scan_ros.drivers.settings import ScannerSettings
from afm_scan_ros.files.records import from_mapping


@define(eq=False)
class DriverHost:
    """Runs one driver as the other end of the link asks."""

    _link: Link
    _driver: GuardedDriver | None = None
    _silence: float = 0.0
    _moved: bool = False
    _signal: str = ""

    def run(self) -> None:
        """Run until asked to stop or until an error; ramp down, and then report.

        Every exception, also one of the watchdog's wait, leads to the ramp.
        """
        error: BaseException | None = None
        try:
            self._work()
        except BaseException as caught:  # noqa: BLE001 - the outputs come to rest whatever it is
            error = caught
        ramp = self._ramp_down()
        with suppress(OSError):  # nobody may be left to hear it
            bad_input = isinstance(error, InputError)
            said = {"why": _described(error), "bad_input": bad_input, "ramp": ramp}
            self._link.send(Message(ENDED, said))

    def interrupt(self, number: int) -> None:
        """End as soon as the driver is idle, as requested by a signal."""
        self._signal = signal.Signals(number).name
        self._link.deafen()

    def _work(self) -> None:
        asked = self._next().fields
        self._silence = asked["silence"]
        settings = from_mapping(ScannerSettings, asked["settings"], asked["where"])
        self._driver = GuardedDriver(asked["driver"], settings, asked["options"], asked["where"])
        self._answer(Message(OPENED, {"knows_true": self._driver.knows_true}))
        while (message := self._next()).kind != STOP:
            if message.kind == START:
                self._driver.start(message.fields["sample_period"])
                self._answer(Message(STARTED))
            elif message.kind == DRIVE:
                self._move(self._driver, message)

    def _move(self, driver: GuardedDriver, message: Message) -> None:
        self._link.patience, self._moved = self._silence, True
        asked = message.fields
        block = Trace(asked["first_sample"], asked["sample_period"], *message.samples)
        answer = driver.advance(block, last=asked["last"])
        traces = [trace for trace in (answer.measured, answer.true) if trace is not None]
        rows = np.stack([trace.axis(axis) for trace in traces for axis in AXES])
        self._answer(Message(MOVED, {"first_sample": answer.measured.first_sample}, rows))

    def _next(self) -> Message:
        """Wait for a message, no longer than the watchdog allows."""
        with self._watching():
            return self._link.receive()

    def _answer(self, message: Message) -> None:
        """Send a message; a node that does not receive it counts as silent."""
        with self._watching():
            self._link.send(message)

    @contextmanager
    def _watching(self) -> Iterator[None]:
        try:
            yield
        except TimeoutError as error:
            raise ScanError(f"the node has been silent for {self._silence:g} s") from error
        except (EOFError, OSError) as error:
            cause = f"interrupted by {self._signal}" if self._signal else "the node is gone"
            raise ScanError(cause) from error

    def _ramp_down(self) -> float | None:
        """Bring the outputs to rest; return how long it took (s), None where that failed."""
        if self._driver is None or not self._moved:
            return 0.0
        try:
            return self._driver.ramp_down()
        except Exception as error:  # noqa: BLE001 - what else is to be done is done by then
            with suppress(OSError):
                traceback.print_exception(error)
            return None


def _described(error: BaseException | None) -> str:
    """Say what ended the work; an error that nobody foresaw is logged with its traceback."""
    if error is None or isinstance(error, InputError | ScanError):
        return str(error or "")
    traceback.print_exception(error)
    return f"{type(error).__name__}: {error}"


def main(descriptor: int) -> None:
    """Run the process whose end of the link is this file descriptor."""
    host = DriverHost(Link(socket.socket(fileno=descriptor)))
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: host.interrupt(number))
    host.run()
