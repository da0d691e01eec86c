"""Drives out and records in by files, where another program moves the scanner."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from attrs import field, frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import ramp_to_rest
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.drivers import DriverChoice
from afm_scan_ros.drivers.guarded import SensorWatch, held_after
from afm_scan_ros.files.columns import parse_columns, read_table_record
from afm_scan_ros.files.records import from_mapping

DRIVE_COLUMNS = ("time_s", "drive_x_v", "drive_y_v")
RECORD_COLUMNS = parse_columns("time=time_s:s,drive_x=sensor_x_v:V,drive_y=sensor_y_v:V")
"""A record's headings: times, and readings of the sensor."""
LOOK = 0.2
"""Seconds between two looks for a record."""
SETTLED = 1.0
"""Seconds after which a record that does not grow is complete."""


@frozen
class FileOptions:
    """The ``options`` of an exchange: its folder, and the longest wait (s) for a record."""

    folder: str
    timeout: float = field(default=3600.0, validator=gt(0.0), metadata={"suffix": "_s"})


class FileExchange:
    """Writes ``NAME.csv`` and waits for ``NAME.measured.csv``, in one folder.

    The settings are those of a driver; no driver runs. Raises InputError for wrong ``options``.
    """

    def __init__(self, choice: DriverChoice) -> None:
        self.settings = choice.settings
        options = from_mapping(FileOptions, choice.options, f"{choice.where}: options")
        self._folder, self._timeout = Path(options.folder), options.timeout

    def displacement(self, name: str, drive: Trace, report: Callable[[str], None]) -> Trace:
        """Let the other program output a whole drive (V); return the displacement (m).

        What it outputs ends at 0 V, by the amplifier's ramp. ``report`` gets what is waited for.
        Raises InputError for a record that does not fit the drive, ScanError for a drive beyond a
        limit, a lost sensor, or no record in time.
        """
        self.settings.amplifier.limits.refuse_beyond(drive, dict.fromkeys(AXES, 0.0))
        late = self.settings.latency_samples
        whole = self._ended(held_after(drive, late))
        target = self._folder / f"{name}.csv"
        record = target.with_name(f"{name}.measured.csv")
        self._write(target, record, whole)
        try:
            self._wait(record, report)
        except BaseException:
            target.unlink(missing_ok=True)  # nobody is to output it unattended
            raise
        read = _readings(record, whole)
        SensorWatch(self.settings, whole.sample_period, late).check(whole, read)
        known = slice(late, late + drive.x.size)
        x, y = self.settings.x.metres(read.x[known]), self.settings.y.metres(read.y[known])
        return Trace(drive.first_sample, drive.sample_period, x, y)

    def _ended(self, drive: Trace) -> Trace:
        """Return a drive (V) with the ramp from its end to rest, where it does not end there."""
        last = {axis: float(drive.axis(axis)[-1]) for axis in AXES}
        if not any(last.values()):
            return drive
        slew = self.settings.amplifier.ramp_down_slew
        ramp = ramp_to_rest(drive.first_sample + drive.x.size, drive.sample_period, last, slew)
        x, y = (np.concatenate([drive.axis(axis), ramp.axis(axis)]) for axis in AXES)
        return Trace(drive.first_sample, drive.sample_period, x, y)

    def _write(self, target: Path, record: Path, drive: Trace) -> None:
        """Write a drive under another name first, so that nobody reads half of it."""
        for path in (target, record):
            if path.exists():
                raise InputError(f"{path} exists already: remove it, or give another folder")
        partial = target.with_suffix(".partial")
        times = drive.sample_period * np.arange(drive.x.size)
        rows = np.column_stack([times, drive.x, drive.y])
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            heading = ",".join(DRIVE_COLUMNS)
            np.savetxt(partial, rows, fmt="%.17g", delimiter=",", header=heading, comments="")
            os.replace(partial, target)  # noqa: PTH105 - the same, and nothing else
        except OSError as error:
            raise InputError(f"{target}: {error.strerror}: give another folder") from error

    def _wait(self, record: Path, report: Callable[[str], None]) -> None:
        """Return when the record is there and has not grown for a while."""
        deadline = time.monotonic() + self._timeout
        size, since = -1, time.monotonic()
        while True:
            now = time.monotonic()
            there = record.stat().st_size if record.exists() else -1
            if there != size:
                size, since = there, now
            if size > 0 and now - since >= SETTLED:
                return
            if now > deadline:
                raise ScanError(f"{record} has not come within {self._timeout:g} s: timeout_s")
            report(f"waits for {record}, for {deadline - now:.0f} s at most")
            time.sleep(LOOK)


def _readings(path: Path, drive: Trace) -> Trace:
    """Return a record's readings (V); raises InputError where they are not those of the drive."""
    found = read_table_record([path], RECORD_COLUMNS)
    count, rate = drive.x.size, 1.0 / drive.sample_period
    if found.samples != count:
        raise InputError(
            f"{path}: {found.samples} samples, but the drive has {count}: record each sample"
        )
    if abs(found.sample_period * rate - 1.0) * count > 0.5:  # noqa: PLR2004 - half a sample at the end
        raise InputError(
            f"{path}: {1.0 / found.sample_period:.9g} samples a second, but the drive has"
            f" {rate:.9g}: output and record at that rate"
        )
    read: dict[str, Array] = dict(found.signals["drive"])
    return Trace(drive.first_sample, drive.sample_period, read["x"], read["y"])
