"""Drivers with faults, for the process that a test starts."""

import os
import signal
import time

from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers.base import Displacement
from afm_scan_ros.drivers.simulated import SimulatedScanner

SLOW = 2.0
"""Seconds for a block."""


class Slow(SimulatedScanner):
    def advance(self, drive: Trace) -> Displacement:
        time.sleep(SLOW)
        return super().advance(drive)


class Killed(SimulatedScanner):
    def advance(self, _: Trace) -> Displacement:
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError


class NeverAtRest(SimulatedScanner):
    def ramp_down(self) -> float:
        raise OSError("no amplifier")


class Unsensed(SimulatedScanner):
    """Reads no noise-free displacement, as no real scanner does."""

    def advance(self, drive: Trace) -> Displacement:
        return Displacement(super().advance(drive).measured)
