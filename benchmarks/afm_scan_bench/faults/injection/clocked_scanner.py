"""A simulated scanner behind an emulated converter, whose sample clock waits for nobody."""

import json
import time
from pathlib import Path

import numpy as np
from attrs import evolve

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers import Reading, ScannerSettings
from afm_scan_ros.drivers.simulated import SimulatedScanner


class ClockedScanner(SimulatedScanner):
    """Outputs drive from a buffer of ``latency_samples``, and reads on the same sample clock.

    The clock begins with the first block; the buffer holds rest by then. A block that comes after
    its first sample was due is an underrun. ``report`` names a file of JSON: when the first sample
    of drive was due (s, the system's monotonic clock), and the least time (s) by which a block
    came early.
    """

    KNOWS_TRUE = False

    def __init__(self, settings: ScannerSettings, report: str) -> None:
        super().__init__(settings)
        self._late, self._report = settings.latency_samples, Path(report)
        self._unread = np.zeros((len(AXES), self._late))
        self._begin = self._first_output = self._least = float("nan")

    def advance(self, drive: Trace) -> Reading:
        """Buffer a block, and return as many readings once they have been taken.

        Raises ScanError for an underrun.
        """
        now, period = time.monotonic(), drive.sample_period
        if np.isnan(self._begin):
            self._begin, self._first_output = now, now + self._late * period
        early = self._begin + (drive.first_sample + self._late) * period - now
        self._least = float(np.fmin(self._least, early))
        if early < 0.0:
            raise ScanError(
                f"sample {drive.first_sample} was not output in time (underrun): it came"
                f" {-early:.3f} s late"
            )
        moved, count = super().advance(drive).sensor, drive.x.size
        self._unread = np.concatenate([self._unread, np.stack([moved.x, moved.y])], axis=1)
        x, y = self._unread[:, :count]
        self._unread = self._unread[:, count:]
        read_at = self._begin + (drive.first_sample + count) * period
        time.sleep(max(0.0, read_at - time.monotonic()))
        return Reading(evolve(moved, x=x, y=y))

    def ramp_down(self) -> float:
        """Ramp down, and write the report."""
        said = {"first_output": self._first_output, "least_s": self._least}
        self._report.write_text(json.dumps(said), "utf-8")
        return super().ramp_down()
