"""The driver process: it owns the outputs, and a watchdog that ramps them down.

It uses neither ROS nor DDS, so a call that blocks there does not affect it. The watchdog is a
timeout on the next message, from the first block of drive on, and one on the next drive until the
last. The time in which the driver works does not count. Each of its calls has a bound of its own:
one that returns later is followed by the ramp, and one that does not return is ended.
"""

import gc
import math
import os
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock, Timer

import numpy as np
from attrs import define, field

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers import OURS, ScannerSettings, link
from afm_scan_ros.drivers.guarded import Displacement, GuardedDriver
from afm_scan_ros.drivers.safety import SafetySettings
from afm_scan_ros.files.records import from_mapping

SILENT = "the node has been silent for {:g} s"
SHORTEST = 1e-3
"""Wait (s) in which a message is read that is there already."""


@define(eq=False)
class DriverHost:
    """Runs one driver as the other end of the link asks."""

    _link: link.Link
    _driver: GuardedDriver | None = None
    _settings: ScannerSettings = field(init=False)
    _waits: link.DriverTimeouts = field(init=False)
    _started: bool = False
    _late: float = 0.0
    _silence: float = math.inf
    _drive_due: float = math.inf
    _next_sample: int = 0
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
        self._report(described(error), ramp, bad_input=isinstance(error, InputError))

    def interrupt(self, number: int) -> None:
        """End as soon as the driver is idle, as requested by a signal."""
        self._signal = signal.Signals(number).name
        self._link.deafen()

    def _work(self) -> None:
        asked = self._next().fields
        self._waits = link.DriverTimeouts(**asked["waits"])
        where = asked["where"]
        self._settings = from_mapping(ScannerSettings, asked["settings"], where)
        name = asked["driver"]
        if name not in OURS:
            sys.path.append(os.getcwd())  # noqa: PTH109 - last, so that it hides no module
        with refusing(f"driver {name}"), bounded("__init__", self._waits.opening, self._waits.rest):
            self._driver = GuardedDriver(name, self._settings, asked["options"], where)
        self._answer(link.Message(link.OPENED, {"knows_true": self._driver.knows_true}))
        while (message := self._next()).kind != link.STOP:
            if message.kind == link.START:
                self._start(self._driver, message.fields["sample_period"])
            elif message.kind == link.DRIVE:
                self._move(self._driver, message)

    def _start(self, driver: GuardedDriver, sample_period: float) -> None:
        with (
            refusing("the driver does not start"),
            bounded("start", self._waits.opening, self._waits.rest),
        ):
            driver.start(sample_period)
            self._started, self._late = True, driver.latency_samples * sample_period
        gc.collect()
        gc.freeze()  # a full collection of what is loaded takes 80 ms, as long as four blocks
        priority = take_priority() if self._waits.real_time else "no real-time priority: no need"
        started = {"latency_samples": driver.latency_samples, "priority": priority}
        self._answer(link.Message(link.STARTED, started))

    def _move(self, driver: GuardedDriver, message: link.Message) -> None:
        begun, self._silence = time.monotonic(), self._waits.silence
        asked = message.fields
        block = Trace(asked["first_sample"], asked["sample_period"], *message.samples)
        answer = self._advance(driver, block, last=asked["last"])
        self._next_sample = block.first_sample + block.x.size
        lasts = begun + block.x.size * block.sample_period
        more = math.inf if asked["last"] else self._waits.starved
        self._drive_due = max(time.monotonic(), lasts) + more
        traces = [trace for trace in (answer.measured, answer.true) if trace is not None]
        rows = np.stack([trace.axis(axis) for trace in traces for axis in AXES])
        self._answer(link.Message(link.MOVED, {"first_sample": answer.measured.first_sample}, rows))

    def _advance(self, driver: GuardedDriver, block: Trace, *, last: bool) -> Displacement:
        """Let the driver advance; where it is late, ramp down meanwhile if that can be."""
        bound = self._waits.for_answer(block, driver.latency_samples)
        if not driver.ramps_while_blocked:
            with bounded("advance", bound, self._waits.rest):
                return driver.advance(block, last=last)

        def take_over() -> None:
            self._report(link.late(bound), self._ramp_down())
            os._exit(1)

        with ending_after(bound + self._ramp_bound), taken_over_after(bound, take_over):
            return driver.advance(block, last=last)

    def _next(self) -> link.Message:
        """Wait for a message, no longer than the watchdog allows."""
        left = self._drive_due - time.monotonic()
        if left < self._silence:
            with self._watching(
                left, f"no drive for {self._waits.starved:g} s, at sample {self._next_sample}"
            ):
                return self._link.receive()
        with self._watching(self._silence, SILENT.format(self._silence)):
            return self._link.receive()

    def _answer(self, message: link.Message) -> None:
        """Send a message; a node that does not receive it counts as silent."""
        with self._watching(self._silence, SILENT.format(self._silence)):
            self._link.send(message)

    @contextmanager
    def _watching(self, wait: float, why: str) -> Iterator[None]:
        self._link.patience = None if wait == math.inf else max(wait, SHORTEST)
        try:
            yield
        except TimeoutError as error:
            raise ScanError(why) from error
        except (EOFError, OSError) as error:
            cause = f"interrupted by {self._signal}" if self._signal else "the node is gone"
            raise ScanError(cause) from error

    def _report(self, why: str, ramp: float | str, *, bad_input: bool = False) -> None:
        """Report why the work has ended, and how long the ramp took (s) or why it failed."""
        self._link.patience = SafetySettings().rest  # the waits may not have come yet
        said = printable(ramp) if isinstance(ramp, str) else ramp
        with suppress(OSError):  # nobody may be left to hear it
            fields = {"why": printable(why), "bad_input": bad_input, "ramp": said}
            self._link.send(link.Message(link.ENDED, fields))

    @property
    def _ramp_bound(self) -> float:
        return link.ramp_bound(self._settings, self._late, self._waits.rest)

    def _ramp_down(self) -> float | str:
        """Bring the outputs to rest; return how long it took (s), or why they may not be."""
        if self._driver is None or not self._started:
            return 0.0
        try:
            with ending_after(self._ramp_bound):
                return self._driver.ramp_down()
        except BaseException as error:  # noqa: BLE001 - what else is to be done is done by then
            return f"the ramp-down failed ({described(error)})"


PRIORITY = 10
"""Real-time priority, of 1 to 99: above all usual work, below the kernel's for devices, 50."""

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
def bounded(call: str, seconds: float, rest: float) -> Iterator[None]:
    """Raise ScanError where a call of the driver has returned late.

    One that has not returned ``rest`` s after its bound is taken to hang, and the process ends.
    """
    begun = time.monotonic()
    with ending_after(seconds + rest):
        yield
    if (taken := time.monotonic() - begun) > seconds:
        raise ScanError(f"{call} of the driver took {taken:.3g} s, and may take {seconds:.3g} s")


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


def take_priority() -> str:
    """Run this thread, and those that it starts, in real time where that is allowed; say so."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (AttributeError, OSError) as error:  # other systems have no such call
        return f"no real-time priority: {error}"
    return f"real-time priority {PRIORITY}"


def printable(text: str) -> str:
    """Return a text with each control character, ends of lines too, as Python writes it."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


@contextmanager
def refusing(what: str) -> Iterator[None]:
    """Raise InputError for whatever a driver raises before it moves, and log where it did."""
    try:
        yield
    except (InputError, ScanError):
        raise
    except Exception as error:
        _log(error)
        raise InputError(f"{what}: {_worded(error)}") from error


def described(error: BaseException | None) -> str:
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
    """Print a traceback, where that is possible: the outputs matter more.

    Each line is marked, so that no text of an exception looks like a line of its own.
    """
    with suppress(Exception):
        lines = "".join(traceback.format_exception(error)).rstrip("\n").split("\n")
        sys.stderr.write("".join(f"| {printable(line)}\n" for line in lines))


def main(descriptor: int) -> None:
    """Run the process whose end of the link is this file descriptor."""
    host = DriverHost(link.Link(socket.socket(fileno=descriptor)))
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: host.interrupt(number))
    host.run()
