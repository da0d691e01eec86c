"""A driver within its scanner's settings: what is the same for every scanner is done here."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.align import end
from afm_scan_ros.core.types import AXES, Array, Trace
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

    A reading that comes ``latency_samples`` late is given the sample of its displacement. So the
    first readings, which are of the time before the drive, are dropped. After the last block the
    drive is held for as many samples.
    """

    def __init__(
        self, driver: str, settings: ScannerSettings, options: Mapping[str, Any], where: str
    ) -> None:
        self._settings = settings
        self._driver: Driver = open_driver(driver_class(driver), settings, options, where)
        self._before = dict.fromkeys(AXES, 0.0)
        self._next_sample = 0
        self._early = settings.latency_samples
        self._watch: SensorWatch

    @property
    def knows_true(self) -> bool:
        """Whether each answer has a noise-free displacement."""
        return self._driver.KNOWS_TRUE

    def start(self, sample_period: float) -> None:
        """Prepare to run at one sample period (s); raises InputError where that is not possible."""
        self._watch = SensorWatch(self._settings, sample_period)
        self._driver.start(sample_period)

    def advance(self, drive: Trace, *, last: bool) -> Displacement:
        """Output a block (V), and return the displacement of all samples known by now.

        Raises ScanError beyond a limit of the drive or the sensor, and where the driver does.
        """
        self._settings.amplifier.limits.refuse_beyond(drive, self._before)
        answers = [self._answer(drive)]
        self._before = {axis: float(drive.axis(axis)[-1]) for axis in AXES}
        if last and (late := self._settings.latency_samples):
            held = (np.full(late, self._before[axis]) for axis in AXES)
            answers.append(self._answer(Trace(end(drive), drive.sample_period, *held)))
        return self._displacement(answers)

    def ramp_down(self) -> float:
        """Ramp the outputs to rest at 0 V; return how long that took (s)."""
        return self._driver.ramp_down()

    def _answer(self, drive: Trace) -> Reading:
        answer = self._driver.advance(drive)
        self._watch.check(drive, answer.sensor)
        return answer

    def _displacement(self, answers: list[Reading]) -> Displacement:
        skipped = min(self._early, sum(answer.sensor.x.size for answer in answers))
        self._early -= skipped
        period = answers[0].sensor.sample_period

        def joined(parts: list[Trace]) -> Trace:
            x, y = (np.concatenate([p.axis(axis) for p in parts])[skipped:] for axis in AXES)
            return Trace(self._next_sample, period, x, y)

        read, true = joined([a.sensor for a in answers]), [a.true for a in answers if a.true]
        moved = Trace(
            read.first_sample, period, self._metres("x", read.x), self._metres("y", read.y)
        )
        displacement = Displacement(moved, joined(true) if true else None)
        self._next_sample += read.x.size
        return displacement

    def _metres(self, axis: str, read: Array) -> Array:
        sensor = {"x": self._settings.x, "y": self._settings.y}[axis]
        return sensor.sensor_scale * (read - sensor.sensor_offset)
