"""Checks of what a displacement sensor reads: finite, within its range, and not standing still."""

import numpy as np

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.drivers.settings import AxisSettings, ScannerSettings, samples_in

LOST = "the sensor is lost: check its cable and its supply"


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
        if read.shape != drive.x.shape:
            raise ScanError(
                f"sample {drive.first_sample}, axis {axis}: the driver returned {read.size}"
                f" readings for {drive.x.size} samples of drive"
            )
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
