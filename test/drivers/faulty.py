"""Drivers with faults, for the process that a test starts."""

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
from attrs import evolve

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import Reading, ScannerSettings
from afm_scan_ros.drivers.simulated import SimulatedScanner

SLOW = 2.0
"""Seconds for a block."""
SCALE, OFFSET, LIMIT = -8e-6, 0.25, 0.35
"""Of a sensor: m/V, V, and the end of its range in V."""
FAULT = 0.5
"""Drive (V) from which there is a fault."""
LATENCY = 7
"""Samples."""


class Slow(SimulatedScanner):
    def advance(self, drive: Trace) -> Reading:
        time.sleep(SLOW)
        return super().advance(drive)


class Hanging(SimulatedScanner):
    """Does not return from one of its calls for some seconds, the interpreter locked or not."""

    def __init__(
        self,
        settings: ScannerSettings,
        call: str,
        *,
        seconds: int = 120,
        locked: bool = False,
        **own: object,
    ) -> None:
        super().__init__(settings, **own)
        Path(f"{own['output_log']}.pid").write_text(str(os.getpid()), "utf-8")
        self._call, self._seconds = call, seconds
        self._sleep = ctypes.PyDLL(None).sleep if locked else time.sleep
        self.hang_in("__init__")

    def hang_in(self, call: str) -> None:
        if call == self._call:
            self._sleep(self._seconds)

    def start(self, sample_period: float) -> None:
        self.hang_in("start")
        super().start(sample_period)

    def advance(self, drive: Trace) -> Reading:
        if drive.first_sample:  # the outputs are up by then
            self.hang_in("advance")
        return super().advance(drive)

    def ramp_down(self) -> float:
        self.hang_in("ramp_down")
        return super().ramp_down()


class RampsMeanwhile(Hanging):
    RAMPS_WHILE_BLOCKED = True


class NoCard(SimulatedScanner):
    def __init__(self, *_: object, **__: object) -> None:
        raise OSError("no card dev0")


class Wordless(SimulatedScanner):
    def __init__(self, *_: object, **__: object) -> None:
        raise ConnectionError


class NoKey(SimulatedScanner):
    def __init__(self, *_: object, **__: object) -> None:
        raise KeyError("dev0")


class NoReading(SimulatedScanner):
    """Forgets to return what it has read."""

    def advance(self, drive: Trace) -> Reading:
        super().advance(drive)
        return None  # type: ignore[return-value] # what a lab may write


class BareReading(SimulatedScanner):
    """Returns its readings without their samples."""

    def advance(self, drive: Trace) -> Reading:
        return Reading(np.stack([drive.x, drive.y]))  # type: ignore[arg-type] # as above


class ListReading(SimulatedScanner):
    """Returns its readings as lists."""

    def advance(self, drive: Trace) -> Reading:
        x, y = drive.x.tolist(), drive.y.tolist()
        return Reading(Trace(drive.first_sample, drive.sample_period, x, y))


class Killed(SimulatedScanner):
    def advance(self, _: Trace) -> Reading:
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError


class NeverAtRest(SimulatedScanner):
    def ramp_down(self) -> float:
        raise OSError("no amplifier")


class Exits(SimulatedScanner):
    def ramp_down(self) -> float:
        sys.exit("no amplifier")


class SaysNothing(SimulatedScanner):
    """Does not say how long its ramp took."""

    def ramp_down(self) -> float:
        super().ramp_down()
        return None  # type: ignore[return-value] # what a lab may write


class Loud(SimulatedScanner):
    """Its error has lines of its own, and sequences that a terminal obeys."""

    def advance(self, _: Trace) -> Reading:
        raise ScanError("no card\n[INFO] the drive is at rest\x1b[2J\r")


class LoudlyClosed(SimulatedScanner):
    def __init__(self, *_: object, **__: object) -> None:
        raise OSError("no card\n[INFO] ready")


class Single(SimulatedScanner):
    """Returns readings as its card does, in single precision."""

    def advance(self, drive: Trace) -> Reading:
        moved = super().advance(drive)
        return Reading(
            *(
                evolve(each, x=np.float32(each.x), y=np.float32(each.y))
                for each in (moved.sensor, moved.true)
            )
        )


class Unlogged(SimulatedScanner):
    """Fails where nothing can be written to stderr, as on a full disk."""

    def advance(self, drive: Trace) -> Reading:
        if drive.first_sample:
            sys.stderr = Path("/dev/full").open("w", buffering=1, encoding="utf-8")  # noqa: SIM115
            raise RuntimeError("injected")
        return super().advance(drive)


class Real(SimulatedScanner):
    """Knows no noise-free displacement, as no real scanner does, and reads volts."""

    KNOWS_TRUE = False

    def advance(self, drive: Trace) -> Reading:
        read = super().advance(drive).sensor
        x, y = (self.volts(axis, read.axis(axis), drive.axis(axis)) for axis in "xy")
        return Reading(Trace(read.first_sample, read.sample_period, x, y))

    def volts(self, _axis: str, metres: np.ndarray, _drive: np.ndarray) -> np.ndarray:
        return OFFSET + metres / SCALE


class LostCable(Real):
    """The sensor of x stands still from some drive on."""

    def volts(self, axis: str, metres: np.ndarray, drive: np.ndarray) -> np.ndarray:
        good = super().volts(axis, metres, drive)
        return np.where(np.maximum.accumulate(drive) > FAULT, OFFSET, good) if axis == "x" else good


class NotANumber(Real):
    def volts(self, axis: str, metres: np.ndarray, drive: np.ndarray) -> np.ndarray:
        return np.where(drive > FAULT, np.nan, super().volts(axis, metres, drive))


class Clipped(Real):
    def volts(self, axis: str, metres: np.ndarray, drive: np.ndarray) -> np.ndarray:
        return np.minimum(super().volts(axis, metres, drive), LIMIT)


class Underrun(Real):
    def volts(self, axis: str, metres: np.ndarray, drive: np.ndarray) -> np.ndarray:
        if np.any(drive > FAULT):
            raise ScanError("underrun: a sample was not output in time")
        return super().volts(axis, metres, drive)


class Broken(Real):
    def volts(self, axis: str, metres: np.ndarray, drive: np.ndarray) -> np.ndarray:
        if np.any(drive > FAULT):
            raise ZeroDivisionError("injected")
        return super().volts(axis, metres, drive)


class Stopped(Real):
    """Its process is killed within a scan."""

    def volts(self, axis: str, metres: np.ndarray, drive: np.ndarray) -> np.ndarray:
        if np.any(drive > FAULT):
            os.kill(os.getpid(), signal.SIGKILL)
        return super().volts(axis, metres, drive)


class Late(Real):
    """Returns each reading some samples late."""

    def start(self, sample_period: float) -> None:
        super().start(sample_period)
        self._kept = {axis: np.full(LATENCY, OFFSET) for axis in "xy"}

    def volts(self, axis: str, metres: np.ndarray, drive: np.ndarray) -> np.ndarray:
        every = np.concatenate([self._kept[axis], super().volts(axis, metres, drive)])
        self._kept[axis] = every[len(drive) :]
        return every[: len(drive)]


class FailsInThirdScan(SimulatedScanner):
    """Fails in its third process, with its outputs away from rest."""

    def __init__(self, settings: ScannerSettings, **own: object) -> None:
        super().__init__(settings, **own)
        begun = Path(f"{own['output_log']}.begun")
        begun.write_text(begun.read_text("utf-8") + "x" if begun.exists() else "x", "utf-8")
        self._scans = len(begun.read_text("utf-8"))

    def advance(self, drive: Trace) -> Reading:
        reading = super().advance(drive)
        if self._scans == 3 and np.any(drive.x > FAULT):
            raise ScanError("the sensor is lost in the third scan")
        return reading
