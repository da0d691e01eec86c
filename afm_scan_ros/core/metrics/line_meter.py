"""Figures that need whole lines: trace against retrace, and one line against the next."""

from math import sqrt

import numpy as np
from attrs import define, field

from afm_scan_ros.core.align import WholeLines
from afm_scan_ros.core.metrics.figures import ErrorSum
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases, sample_kinds
from afm_scan_ros.core.types import Array, Trace


@define
class LineMeter:
    """Compares the lines of a to-and-fro scan, in constant memory."""

    spec: ScanSpec
    mismatch: ErrorSum = field(factory=ErrorSum)
    _jitter_x: ErrorSum = field(factory=ErrorSum)
    _jitter_y: ErrorSum = field(factory=ErrorSum)
    _whole: WholeLines = field(init=False)
    _trace: slice = field(init=False)
    _before: Array | None = None

    def __attrs_post_init__(self) -> None:
        lines, size = phases(self.spec).lines, self.spec.samples_per_line
        self._whole = WholeLines(lines, size, 3)
        trace = np.flatnonzero(sample_kinds(self.spec, lines.start, size).trace)
        self._trace = slice(trace[0], trace[-1] + 1) if trace.size else slice(0, 0)

    def add(self, desired: Trace, achieved: Trace) -> None:
        """Take the next run of samples, the same of both; runs follow each other."""
        rows = np.stack([achieved.x, achieved.x - desired.x, achieved.y - desired.y])
        for number, line in self._whole.add(desired.first_sample, rows):
            self._compare(number, line)

    def repeatability(self) -> tuple[float | None, float | None]:
        """Return the rms change (m) from line to line in x and y; None before the third line."""
        x, y = (
            total.rms() / sqrt(2.0) if total.count else None
            for total in (self._jitter_x, self._jitter_y)
        )
        return x, y

    def _compare(self, number: int, line: Array) -> None:
        """Compare trace with retrace, and a line with the one before; the first is left out."""
        first, stop = max(1, self._trace.start), self._trace.stop
        if number == 0 or first >= stop:
            return
        x = line[0]
        self.mismatch = self.mismatch.plus(x[first:stop] - x[x.size - first : x.size - stop : -1])
        errors = line[1:, self._trace]
        if self._before is not None:
            change = errors - self._before
            change -= change.mean(axis=1, keepdims=True)
            self._jitter_x = self._jitter_x.plus(change[0])
            self._jitter_y = self._jitter_y.plus(change[1])
        self._before = errors.copy()
