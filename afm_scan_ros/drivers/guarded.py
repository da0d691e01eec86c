"""A driver within its scanner's settings: limits, units, latency, and checks of its readings."""

import math
import reprlib
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.drivers import (
    AxisSettings,
    Driver,
    Reading,
    ScannerSettings,
    driver_class,
    open_driver,
    samples_in,
)

LOST = "the sensor is lost: check its cable and its supply"
PERIOD_ROUNDING = 1e-6
"""Relative error of a sample period that was once a float32."""
PLAIN = (np.ndarray, np.memmap, np.ma.MaskedArray)
"""Arrays whose numbers alone say what they hold, as those of a library with units do not."""


class SensorWatch:
    """Refuses the readings of a lost or clipped sensor, however the signals are cut into blocks.

    A reading is lost where it stays exactly the same while the mean of the drive over windows of
    the response time and the ``latency`` (samples) changes by more than the drive's resolution.
    Noise and quantisation of a working sensor never hold a reading still then. The last window of
    drive is not judged, since the scanner may not have followed it yet.
    """

    def __init__(self, settings: ScannerSettings, sample_period: float, latency: int) -> None:
        self._ranges: dict[str, AxisSettings] = {"x": settings.x, "y": settings.y}
        self._resolution = settings.drive_resolution
        self._window = latency + samples_in(settings.response_time, sample_period)
        self._filled = 0
        self._drive = np.zeros(len(AXES))
        self._same = np.zeros(len(AXES), dtype=bool)
        self._held = np.full(len(AXES), np.nan)
        self._low, self._high = np.full((2, len(AXES)), np.nan)

    def check(self, drive: Trace, sensor: Trace) -> None:
        """Take a block of drive (V) and its readings (V).

        Raises ScanError naming the sample, the axis and the reason.
        """
        for axis in AXES:
            self._refuse_out_of_range(axis, sensor.axis(axis), drive)
        volts, read = (np.stack([each.x, each.y]) for each in (drive, sensor))
        start, count = 0, drive.x.size
        while start < count:
            stop = min(count, start + self._window - self._filled)
            self._add(volts[:, start:stop], read[:, start:stop])
            start = stop
            if self._filled == self._window:
                self._judge(drive.first_sample + stop)

    def _refuse_out_of_range(self, axis: str, read: Array, drive: Trace) -> None:
        low, high = self._ranges[axis].sensor_low, self._ranges[axis].sensor_high
        if low < np.min(read) <= np.max(read) < high:  # NaN is not
            return
        place = int(np.flatnonzero(~((low < read) & (read < high)))[0])
        where = (
            f"sample {drive.first_sample + place}, axis {axis}: the sensor reads {read[place]:g} V"
        )
        if not np.isfinite(read[place]):
            raise ScanError(f"{where}; {LOST}")
        raise ScanError(
            f"{where}, which is clipped at {low:g} or {high:g} V: scan a smaller range, or check"
            " the sensor's offset"
        )

    def _add(self, drive: Array, read: Array) -> None:
        """Add samples, (2, n) each, to the window."""
        if self._filled == 0:
            self._drive[:], self._same[:] = 0.0, True
        self._drive += drive.sum(axis=1)
        self._same &= np.all(read == self._held[:, None], axis=1)
        self._held = np.where(self._same, self._held, read[:, -1])
        self._filled += read.shape[1]

    def _judge(self, end: int) -> None:
        """End a window; the drives of the windows before it have had time to act."""
        self._filled = 0
        moved = np.where(self._same, self._high - self._low, 0.0)
        for axis, reading, change in zip(AXES, self._held, moved, strict=True):
            if change > self._resolution:
                raise ScanError(
                    f"sample {end - 1}, axis {axis}: the sensor has read exactly {reading:g} V"
                    f" while the drive moved by {change:.3g} V; {LOST}"
                )
        mean = self._drive / self._window
        self._low = np.where(self._same, np.fmin(self._low, mean), np.nan)
        self._high = np.where(self._same, np.fmax(self._high, mean), np.nan)


def held_after(drive: Trace, late: int) -> Trace:
    """Return a drive that is held at its end for so many samples."""
    x, y = (np.pad(drive.axis(axis), (0, late), "edge") for axis in AXES)
    return Trace(drive.first_sample, drive.sample_period, x, y)


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
        return bool(self._driver.KNOWS_TRUE)

    @property
    def ramps_while_blocked(self) -> bool:
        """Whether another thread may ramp down while ``advance`` does not return."""
        return self._driver.RAMPS_WHILE_BLOCKED

    def start(self, sample_period: float) -> None:
        """Prepare to run at one sample period (s); raises InputError where that is not possible.

        Checks are compiled now, not while a block is due.
        """
        self._refuse(Trace(0, sample_period, np.zeros(2), np.zeros(2)))
        buffered: object = self._driver.buffered(sample_period)
        if not isinstance(buffered, Integral) or buffered < 0:
            raise InputError(f"buffered of the driver returned {buffered!r}, and not samples")
        late = self._settings.latency_samples + int(buffered)
        self.latency_samples = self._early = late
        self._watch = SensorWatch(self._settings, sample_period, late)
        self._driver.start(sample_period)

    def advance(self, drive: Trace, *, last: bool) -> Displacement:
        """Output a block (V), and return the displacement of all samples known by now.

        Raises ScanError beyond a limit of the drive or the sensor, and where the driver does.
        """
        self._refuse(drive)
        self._before = {axis: float(drive.axis(axis)[-1]) for axis in AXES}
        whole = held_after(drive, self.latency_samples) if last else drive
        answer = checked(self._driver.advance(whole), whole, knows_true=self.knows_true)
        self._watch.check(whole, answer.sensor)
        read, true = self._dated(answer.sensor), self._dated(answer.true) if answer.true else None
        self._next_sample += read.x.size
        self._early -= answer.sensor.x.size - read.x.size
        x, y = self._settings.x.metres(read.x), self._settings.y.metres(read.y)
        return Displacement(Trace(read.first_sample, read.sample_period, x, y), true)

    def ramp_down(self) -> float:
        """Ramp the outputs to rest at 0 V; return how long that took (s).

        Raises ScanError where the driver does not say how long: it may not have ramped down.
        """
        taken: object = self._driver.ramp_down()
        if not isinstance(taken, Real) or isinstance(taken, bool):
            raise ScanError(f"ramp_down returned {reprlib.repr(taken)}, and not its duration in s")
        if not 0.0 <= (duration := float(taken)) < math.inf:
            raise ScanError(f"ramp_down returned {duration:g}, and not its duration in s")
        return duration

    def _refuse(self, drive: Trace) -> None:
        self._settings.amplifier.limits.refuse_beyond(drive, self._before)

    def _dated(self, late: Trace) -> Trace:
        """Return readings as of the samples of their displacement, without those before it."""
        known = slice(self._early, None)
        return Trace(self._next_sample, late.sample_period, late.x[known], late.y[known])


def checked(answer: object, drive: Trace, *, knows_true: bool) -> Reading:
    """Return a driver's answer to a block of drive as float64, at the samples of the block.

    Raises ScanError naming the sample, the axis and what does not hold.
    """
    where = f"sample {drive.first_sample}"
    if not isinstance(answer, Reading) or not isinstance(answer.sensor, Trace):
        raise ScanError(f"{where}: advance of the driver must return Reading(Trace(...))")
    sensor = _at_the_samples(answer.sensor, drive, "readings")
    if (answer.true is not None) is not knows_true:
        raise ScanError(
            f"{where}: KNOWS_TRUE of the driver is {knows_true}, but its Reading has"
            f" {'no' if knows_true else 'a'} true displacement"
        )
    if answer.true is None:
        return Reading(sensor)
    true = _at_the_samples(answer.true, drive, "true displacement")
    for axis in AXES:
        if not np.all(finite := np.isfinite(true.axis(axis))):
            place = drive.first_sample + int(np.argmin(finite))
            raise ScanError(f"sample {place}, axis {axis}: the true displacement is not finite")
    return Reading(sensor, true)


def _at_the_samples(given: object, drive: Trace, what: str) -> Trace:
    """Return samples as float64; raises ScanError where they are not those of the drive."""
    where = f"sample {drive.first_sample}: the driver's {what}"
    if not isinstance(given, Trace):
        raise ScanError(f"{where} must be a Trace, and not {_kind(given)}")
    first, period = given.first_sample, given.sample_period
    if not isinstance(first, Real) or first != drive.first_sample:
        raise ScanError(f"{where}: first_sample = {first} is not that of the drive")
    close = isinstance(period, Real) and math.isclose(
        period, drive.sample_period, rel_tol=PERIOD_ROUNDING
    )
    if not close:
        raise ScanError(
            f"{where}: sample_period = {period} is not that of the drive, {drive.sample_period:g}"
        )
    x, y = (_floats(given.axis(axis), drive, what, axis) for axis in AXES)
    return Trace(drive.first_sample, drive.sample_period, x, y)


def _floats(given: Array, drive: Trace, what: str, axis: str) -> Array:
    """Return the samples of an axis as contiguous float64, as they are where they are that."""
    where = f"sample {drive.first_sample}, axis {axis}: the driver's {what}"
    if type(given) not in PLAIN or given.dtype.kind not in "fiu":
        raise ScanError(f"{where} must be a plain array of real numbers, and not {_kind(given)}")
    if given.shape != drive.x.shape:
        raise ScanError(
            f"{where}, of shape {given.shape}, must have that of the drive, {drive.x.shape}"
        )
    if np.ma.is_masked(given):
        place = drive.first_sample + int(np.argmax(np.ma.getmaskarray(given)))
        raise ScanError(f"sample {place}, axis {axis}: masked in the driver's {what}, so none")
    with np.errstate(over="ignore"):  # what no float64 can hold is out of every range
        return np.ascontiguousarray(given, dtype=np.float64)


def _kind(given: object) -> str:
    name = type(given).__name__
    return f"{name} of {given.dtype}" if isinstance(given, np.ndarray) else name
