"""Faults of the process that owns a scanner's ROS side, of its driver, and of what they talk to."""

import ctypes
import signal
import time
from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.drivers import AxisSettings, DriverChoice, Reading, ScannerSettings
from afm_scan_ros.drivers.link import Link
from afm_scan_ros.drivers.simulated import SimulatedScanner
from afm_scan_ros.nodes.block_source import ExcitationGenerator
from afm_scan_ros.nodes.run import run_node
from afm_scan_ros.nodes.scan_node import ScanNode
from afm_scan_ros.nodes.scan_recorder import ScanRecorder
from afm_scan_ros.nodes.scanner_node import PiezoscannerSim

FAULT_AT = 20_000
"""Sample from which there is a fault: after a second."""
HANG = 120
"""Seconds."""
LATE = 0.8
"""Seconds after which an answer comes that is due after 0.3."""
SENSOR = AxisSettings(1.0, 0.0, -100e-6, 100e-6)
"""The simulated sensor reads metres; these are the ends of its converter's range."""
RESPONSE, RESOLUTION = 0.02, 0.05
"""Seconds and volts after which a reading that stands still is that of a lost sensor."""


def _raise(*_: object) -> None:
    raise ZeroDivisionError("injected")


def _hang() -> None:
    """Sleep in C, and keep the interpreter locked."""
    ctypes.PyDLL(None).sleep(HANG)


def _sleep() -> None:
    """Sleep, while other threads work."""
    time.sleep(HANG)


def note(log: object) -> None:
    """Write down the moment of a fault, beside the log of the outputs."""
    path = Path(f"{log}.fault")
    if not path.exists():
        path.write_text(str(time.monotonic()), "utf-8")


@frozen
class Fault:
    """A fault; ``message`` is in the scan's nodes' reports of it.

    From FAULT_AT on, ``method`` of the scanner's node, or of ``to``, does ``act`` in place of its
    work, or the driver ``driver`` of this module fails; or the bench sends ``number`` to ``to``,
    or blocks publish by a ``viewer`` that it stops, or publishes ``forged`` drive.
    """

    name: str
    message: str
    method: str = ""
    act: Callable[[], None] = _raise
    driver: str = ""
    number: int = 0
    to: str = "node"
    viewer: bool = False
    forged: bool = False


_BUG = "ZeroDivisionError: injected"
SOURCE, SCANNER, RECORDER = "excitation_generator", "piezoscanner_sim", "scan_recorder"
SILENT = f"{SCANNER} has been silent"
HANGS = f"{SCANNER} has finished no sample"
_SOURCE_SILENT = f"{SOURCE} has been silent"
_RECORDER_SILENT = f"{RECORDER} has been silent"
_LOST = "the sensor is lost"
FAULTS = (
    Fault("scanner's node killed (SIGKILL)", SILENT, number=signal.SIGKILL),
    Fault("source's node killed (SIGKILL)", _SOURCE_SILENT, number=signal.SIGKILL, to=SOURCE),
    Fault("recorder killed (SIGKILL)", _RECORDER_SILENT, number=signal.SIGKILL, to=RECORDER),
    Fault("recorder stopped (SIGSTOP)", _RECORDER_SILENT, number=signal.SIGSTOP, to=RECORDER),
    Fault(
        "recorder hangs, its heartbeat goes on",
        f"{RECORDER} has finished no sample",
        "receive_raw",
        _sleep,
        to=RECORDER,
    ),
    Fault(
        "source hangs, its heartbeat goes on",
        f"{SOURCE} has finished no sample",
        "step",
        _sleep,
        to=SOURCE,
    ),
    Fault("driver answers half a second late", "advance of the driver took", driver="LateScanner"),
    Fault("driver hangs, another thread can ramp", "has not answered", driver="HungScanner"),
    Fault("forged drive of this scan", "drive_voltage", forged=True),
    Fault("scanner's node stopped (SIGSTOP)", SILENT, number=signal.SIGSTOP),
    Fault("source's node stopped (SIGSTOP)", _SOURCE_SILENT, number=signal.SIGSTOP, to=SOURCE),
    Fault("publish blocks, the interpreter locked", SILENT, viewer=True),
    Fault("a callback hangs, the interpreter locked", SILENT, "consume", _hang),
    Fault("a callback hangs, its heartbeat goes on", HANGS, "consume", _sleep),
    Fault("sensor lost (constant reading)", _LOST, driver="LostSensor"),
    Fault("sensor reads NaN", _LOST, driver="NanSensor"),
    Fault("sensor clipped", "which is clipped", driver="ClippedSensor"),
    Fault("underrun", "was not output in time (underrun)", driver="Underrun"),
    Fault("overrun", "was not read in time (overrun)", driver="Overrun"),
    Fault("exception in the callback of a block", _BUG, "consume"),
    Fault("exception in the callback of node_state", _BUG, "_hear"),
    Fault("exception in the periodic work", _BUG, "step"),
    Fault("exception in publish", _BUG, "send"),
    Fault("exception in the driver", _BUG, driver="RaisingScanner"),
    Fault("exception in the watchdog", _BUG, driver="RaisingWatchdog"),
    Fault("SIGINT to the node's group", "interrupted by SIGINT", number=signal.SIGINT, to="group"),
    Fault(
        "SIGTERM to the node's group", "interrupted by SIGTERM", number=signal.SIGTERM, to="group"
    ),
    Fault("SIGTERM to the driver's process", "by SIGTERM", number=signal.SIGTERM, to="driver"),
)
BY_NAME = {fault.name: fault for fault in FAULTS}


class FaultyScanner(SimulatedScanner):
    """A scanner with a fault within a scan."""

    def __init__(self, settings: ScannerSettings, **options: object) -> None:
        super().__init__(settings, **options)  # type: ignore[arg-type] # what the node gives
        self._noted_in = options["output_log"]

    def advance(self, drive: Trace) -> Reading:
        """Move, up to the fault."""
        if drive.first_sample < FAULT_AT:
            return super().advance(drive)
        note(self._noted_in)
        return self.fail(drive)

    @abstractmethod
    def fail(self, drive: Trace) -> Reading:
        """Answer a block as a scanner with the fault does."""

    def misread(self, drive: Trace, change: Callable[[Array], Array]) -> Reading:
        """Move, and change what the sensor of x reads."""
        moved = super().advance(drive)
        return evolve(moved, sensor=evolve(moved.sensor, x=change(moved.sensor.x)))


class LostSensor(FaultyScanner):
    """Its sensor reads the same for ever."""

    _last = float("nan")

    def fail(self, drive: Trace) -> Reading:
        """Repeat the first reading."""

        def still(read: Array) -> Array:
            self._last = read[0] if np.isnan(self._last) else self._last
            return np.full_like(read, self._last)

        return self.misread(drive, still)


class NanSensor(FaultyScanner):
    """Its sensor reads what is no number, once a block."""

    def fail(self, drive: Trace) -> Reading:
        """Spoil the last reading."""
        return self.misread(drive, lambda read: np.append(read[:-1], np.nan))


class ClippedSensor(FaultyScanner):
    """Its sensor is beyond the converter's range."""

    def fail(self, drive: Trace) -> Reading:
        """Read the end of the range."""
        return self.misread(drive, lambda read: np.full_like(read, SENSOR.sensor_high))


class Underrun(FaultyScanner):
    """Its converter had no sample to output."""

    def fail(self, drive: Trace) -> Reading:
        """Raise what a driver of hardware raises then."""
        raise ScanError(f"sample {drive.first_sample} was not output in time (underrun)")


class Overrun(FaultyScanner):
    """Its converter's readings were overwritten."""

    def fail(self, drive: Trace) -> Reading:
        """Raise what a driver of hardware raises then."""
        raise ScanError(f"sample {drive.first_sample} was not read in time (overrun)")


class RaisingScanner(FaultyScanner):
    """Its own code has a fault that nobody foresaw."""

    def fail(self, drive: Trace) -> Reading:
        """Raise it."""
        _raise()
        return super().advance(drive)


class LateScanner(FaultyScanner):
    """Its converter stalls for longer than it may; the outputs can be ramped from its return on."""

    def fail(self, drive: Trace) -> Reading:
        """Answer half a second after the answer is due."""
        time.sleep(LATE)
        Path(f"{self._noted_in}.fault").unlink()
        note(self._noted_in)
        return SimulatedScanner.advance(self, drive)


class HungScanner(FaultyScanner):
    """Its call never returns, and its outputs can be ramped meanwhile."""

    RAMPS_WHILE_BLOCKED = True

    def fail(self, drive: Trace) -> Reading:
        """Wait for ever."""
        _sleep()
        return SimulatedScanner.advance(self, drive)


class RaisingWatchdog(FaultyScanner):
    """The watchdog's wait in its process raises."""

    def fail(self, drive: Trace) -> Reading:
        """Break the next wait."""
        setattr(Link, "receive", _raise)  # noqa: B010 - no method, to the type checker
        return SimulatedScanner.advance(self, drive)


def faulty_node(name: str, log: str) -> int:
    """Run the scanner's node with a fault in it; return its status."""
    fault = BY_NAME[name]
    if fault.method and fault.to == "node":
        _break(PiezoscannerSim, fault.method, fault.act, log)
    watch_the_sensor(f"{__name__}:{fault.driver}" if fault.driver else "")
    return run_node(PiezoscannerSim.NAME)


def faulty_neighbour(name: str, log: str) -> int:
    """Run the source or the recorder with a fault in it; return its status."""
    fault = BY_NAME[name]
    kind: type[ScanNode] = ScanRecorder if fault.to == RECORDER else ExcitationGenerator
    _break(kind, fault.method, fault.act, log)
    return run_node(kind.NAME)


def watch_the_sensor(driver: str = "") -> None:
    """Check the readings of the simulated sensor, as those of a real one, by another ``driver``."""
    kind = PiezoscannerSim
    whole = kind.choice

    def choice(node: PiezoscannerSim) -> DriverChoice:
        given = whole(node)
        watched = evolve(
            given.settings,
            x=SENSOR,
            y=SENSOR,
            response_time=RESPONSE,
            drive_resolution=RESOLUTION,
        )
        return evolve(given, settings=watched, driver=driver or given.driver)

    setattr(kind, "choice", choice)  # noqa: B010 - no method, to the type checker


def _break(kind: type[ScanNode], method: str, act: Callable[[], None], log: str) -> None:
    whole = getattr(kind, method)

    def broken(node: ScanNode, *given: object, **named: object) -> object:
        if node.next_sample < FAULT_AT:
            return whole(node, *given, **named)
        note(log)
        act()
        return None

    setattr(kind, method, broken)
