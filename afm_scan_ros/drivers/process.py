"""The driver process: it owns the outputs, and a watchdog that ramps them down.

It uses neither ROS nor DDS, so a call that blocks there does not affect it. The watchdog is a
timeout on the next message, from the first block of drive on. The time in which the driver works
does not count. Each of its calls has a bound of its own, at which the process ends.
"""

import os
import signal
import socket
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock, Timer

import numpy as np
from attrs import define, field

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers import ScannerSettings
from afm_scan_ros.drivers.guarded import Displacement, GuardedDriver
from afm_scan_ros.drivers.link import (
    DRIVE,
    ENDED,
    MOVED,
    OPENED,
    START,
    STARTED,
    STOP,
    DriverTimeouts,
    Link,
    Message,
    late,
    ramp_bound,
)
from afm_scan_ros.files.records import from_mapping

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


@define(eq=False)
class DriverHost:
    """Runs one driver as the other end of the link asks."""

    _link: Link
    _driver: GuardedDriver | None = None
    _settings: ScannerSettings = field(init=False)
    _waits: DriverTimeouts = field(init=False)
    _started: bool = False
    _late: float = 0.0
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
        self._report(_described(error), ramp, bad_input=isinstance(error, InputError))

    def interrupt(self, number: int) -> None:
        """End as soon as the driver is idle, as requested by a signal."""
        self._signal = signal.Signals(number).name
        self._link.deafen()

    def _work(self) -> None:
        asked = self._next().fields
        self._waits = DriverTimeouts(**asked["waits"])
        where = asked["where"]
        self._settings = from_mapping(ScannerSettings, asked["settings"], where)
        with ending_after(self._waits.opening), _refusing(f"driver {asked['driver']}"):
            self._driver = GuardedDriver(asked["driver"], self._settings, asked["options"], where)
        self._answer(Message(OPENED, {"knows_true": self._driver.knows_true}))
        while (message := self._next()).kind != STOP:
            if message.kind == START:
                self._start(self._driver, message.fields["sample_period"])
            elif message.kind == DRIVE:
                self._move(self._driver, message)

    def _start(self, driver: GuardedDriver, sample_period: float) -> None:
        with ending_after(self._waits.opening), _refusing("the driver does not start"):
            driver.start(sample_period)
        self._started, self._late = True, driver.latency_samples * sample_period
        self._answer(Message(STARTED, {"latency_samples": driver.latency_samples}))

    def _move(self, driver: GuardedDriver, message: Message) -> None:
        self._link.patience = self._waits.silence
        asked = message.fields
        block = Trace(asked["first_sample"], asked["sample_period"], *message.samples)
        answer = self._advance(driver, block, last=asked["last"])
        traces = [trace for trace in (answer.measured, answer.true) if trace is not None]
        rows = np.stack([trace.axis(axis) for trace in traces for axis in AXES])
        self._answer(Message(MOVED, {"first_sample": answer.measured.first_sample}, rows))

    def _advance(self, driver: GuardedDriver, block: Trace, *, last: bool) -> Displacement:
        """Let the driver advance; where it hangs, ramp down meanwhile if that can be."""
        bound = self._waits.for_answer(block, driver.latency_samples)
        if not driver.ramps_while_blocked:
            with ending_after(bound):
                return driver.advance(block, last=last)

        def take_over() -> None:
            self._report(late(bound), self._ramp_down())
            os._exit(1)

        with ending_after(bound + self._ramp_bound), taken_over_after(bound, take_over):
            return driver.advance(block, last=last)

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
            raise ScanError(f"the node has been silent for {self._waits.silence:g} s") from error
        except (EOFError, OSError) as error:
            cause = f"interrupted by {self._signal}" if self._signal else "the node is gone"
            raise ScanError(cause) from error

    def _report(self, why: str, ramp: float | None, *, bad_input: bool = False) -> None:
        """Report why the work has ended, and how long the ramp took."""
        with suppress(OSError):  # nobody may be left to hear it
            fields = {"why": why, "bad_input": bad_input, "ramp": ramp}
            self._link.send(Message(ENDED, fields))

    @property
    def _ramp_bound(self) -> float:
        return ramp_bound(self._settings, self._late)

    def _ramp_down(self) -> float | None:
        """Bring the outputs to rest; return how long it took (s), None where that failed."""
        if self._driver is None or not self._started:
            return 0.0
        try:
            with ending_after(self._ramp_bound):
                return self._driver.ramp_down()
        except Exception as error:  # noqa: BLE001 - what else is to be done is done by then
            _log(error)
            return None


@contextmanager
def _refusing(what: str) -> Iterator[None]:
    """Raise InputError for whatever a driver raises before it moves, and log where it did."""
    try:
        yield
    except (InputError, ScanError):
        raise
    except Exception as error:
        _log(error)
        raise InputError(f"{what}: {_worded(error)}") from error


def _described(error: BaseException | None) -> str:
    """Say what ended the work, and where if nobody foresaw it; log its traceback then."""
    if error is None or isinstance(error, InputError | ScanError):
        return str(error or "")
    _log(error)
    said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    with suppress(Exception):  # the outputs matter more
        *_, place = traceback.extract_tb(error.__traceback__)
        said += f" ({Path(place.filename).name}, line {place.lineno})"
    return said


def _worded(error: Exception) -> str:
    """Return what an exception says, by its name where that is nothing, or a key alone."""
    said, name = str(error), type(error).__name__
    if isinstance(error, LookupError):
        return f"{name}: {said}"
    return said or name


def _log(error: BaseException) -> None:
    """Print a traceback, where that is possible: the outputs matter more."""
    with suppress(Exception):
        traceback.print_exception(error)


def main(descriptor: int) -> None:
    """Run the process whose end of the link is this file descriptor."""
    host = DriverHost(Link(socket.socket(fileno=descriptor)))
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: host.interrupt(number))
    host.run()
