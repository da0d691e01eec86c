"""Single samples of a scan for viewers: desired, achieved, error and drive."""

from collections import deque
from collections.abc import Iterator
from math import ceil, nan

from attrs import frozen

from afm_scan_ros.core.align import Aligner, end
from afm_scan_ros.core.types import Trace

MONITOR_RATE = 200.0
"""Samples a second, at most."""

DRIVE = "drive_voltage"


@frozen
class MonitorSample:
    """One sample: displacement in m, drive in V, both not a number where they are not known."""

    sample: int
    desired_x: float
    desired_y: float
    achieved_x: float
    achieved_y: float
    error_x: float
    error_y: float
    drive_x: float
    drive_y: float


class MonitorSamples:
    """Aligns three streams of blocks, and yields each sample that is a multiple of a step.

    The step is the smallest with which they are ``MONITOR_RATE`` a second of the scan at most;
    ``sample_period`` in s. No sample waits for the drive: a recording may hold none.
    """

    def __init__(self, sample_period: float) -> None:
        self._step = ceil(1.0 / (MONITOR_RATE * sample_period) - 1e-9)
        self._aligner = Aligner(("desired_displacement", "achieved_displacement"))
        self._drive: deque[Trace] = deque()

    def add(self, name: str, block: Trace) -> Iterator[MonitorSample]:
        """Take the next block of one of the three topics; yield the samples that it completes."""
        if name == DRIVE:
            self._drive.append(block)
            return
        self._aligner.add(name, block)
        for desired, achieved in self._aligner.ready():
            first = desired.first_sample
            for sample in range(first + -first % self._step, end(desired), self._step):
                yield self._sample(sample, desired, achieved)

    def _sample(self, sample: int, desired: Trace, achieved: Trace) -> MonitorSample:
        at = sample - desired.first_sample
        (dx, dy), (ax, ay) = ((float(t.x[at]), float(t.y[at])) for t in (desired, achieved))
        drive_x, drive_y = self._drive_at(sample)
        return MonitorSample(sample, dx, dy, ax, ay, ax - dx, ay - dy, drive_x, drive_y)

    def _drive_at(self, sample: int) -> tuple[float, float]:
        """Return the drive of a sample, and forget what lies before it."""
        while self._drive and end(self._drive[0]) <= sample:
            self._drive.popleft()
        if not self._drive or (head := self._drive[0]).first_sample > sample:
            return nan, nan
        at = sample - head.first_sample
        return float(head.x[at]), float(head.y[at])
