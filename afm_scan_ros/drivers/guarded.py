"""A driver within its scanner's settings: what is the same for every scanner is done here."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers.base import Driver, Reading, driver_class, open_driver
from afm_scan_ros.drivers.sensor import SensorWatch
from afm_scan_ros.drivers.settings import ScannerSettings


@frozen
class Displacement:
    """Displacement (m): as measured, and without noise where the driver knows that."""

    measured: Trace
    true: Trace | None = None


class GuardedDriver:
    """Checks drive and readings of a driver, and turns readings (V) into displacement (m).

    A reading that comes ``latency_samples`` late, those of the driver's buffer included, is given
    the sample of its displacement. So the first readings, which are of the time before the drive,
    are dropped. After the last block the drive is held for as many samples.
    """

    def __init__(
        self, driver: str, settings: ScannerSettings, options: Mapping[str, Any], where: str
    ) -> None:
        self._settings = settings
        self._driver: Driver = open_driver(driver_class(driver), settings, options, where)
        self._before = dict.fromkeys(AXES, 0.0)
        self._next_sample = 0
        self.latency_samples = self._early = 0
        self._watch: SensorWatch

    @property
    def knows_true(self) -> bool:
        """Whether each answer has a noise-free displacement."""
        return self._driver.KNOWS_TRUE

    @property
    def ramps_while_blocked(self) -> bool:
        """Whether another thread may ramp down while ``advance`` does not return."""
        return self._driver.RAMPS_WHILE_BLOCKED

    def start(self, sample_period: float) -> None:
        """Prepare to run at one sample period (s); raises InputError where that is not possible.

        Checks are compiled now, not while a block is due.
        """
        self._refuse(Trace(0, sample_period, np.zeros(2), np.zeros(2)))
        late = self._settings.latency_samples + self._driver.buffered(sample_period)
        self.latency_samples = self._early = late
        self._watch = SensorWatch(self._settings, sample_period, late)
        self._driver.start(sample_period)

    def advance(self, drive: Trace, *, last: bool) -> Displacement:
        """Output a block (V), and return the displacement of all samples known by now.

        Raises ScanError beyond a limit of the drive or the sensor, and where the driver does.
        """
        self._refuse(drive)
        self._before = {axis: float(drive.axis(axis)[-1]) for axis in AXES}
        answer = self._answer(self._held_after(drive) if last else drive)
        read, true = self._dated(answer.sensor), self._dated(answer.true) if answer.true else None
        self._next_sample += read.x.size
        self._early -= answer.sensor.x.size - read.x.size
        x, y = self._settings.x.metres(read.x), self._settings.y.metres(read.y)
        return Displacement(Trace(read.first_sample, read.sample_period, x, y), true)

    def ramp_down(self) -> float:
        """Ramp the outputs to rest at 0 V; return how long that took (s)."""
        return self._driver.ramp_down()

    def _refuse(self, drive: Trace) -> None:
        self._settings.amplifier.limits.refuse_beyond(drive, self._before)

    def _answer(self, drive: Trace) -> Reading:
        answer = self._driver.advance(drive)
        if not isinstance(answer, Reading) or not isinstance(answer.sensor, Trace):
            raise ScanError(
                f"sample {drive.first_sample}: advance of the driver must return"
                " Reading(Trace(...)), with the readings of the same samples"
            )
        self._watch.check(drive, answer.sensor)
        return answer

    def _held_after(self, drive: Trace) -> Trace:
        late = self.latency_samples
        x, y = (np.pad(drive.axis(axis), (0, late), "edge") for axis in AXES)
        return Trace(drive.first_sample, drive.sample_period, x, y)

    def _dated(self, late: Trace) -> Trace:
        """Return readings as of the samples of their displacement, without those before it."""
        known = slice(self._early, None)
        return Trace(self._next_sample, late.sample_period, late.x[known], late.y[known])
