"""Gathers the error of a scan block by block, in constant memory.

Some figures need whole lines: trace against retrace, and one line against the next.
"""

from collections import defaultdict
from math import sqrt

import numpy as np
from attrs import define, field
from numpy.typing import NDArray

from afm_scan_ros.core.align import WholeLines
from afm_scan_ros.core.metrics.figures import AxisError, ErrorSum, Tracking
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases, sample_kinds
from afm_scan_ros.core.trajectory.kinds import TO_AND_FRO
from afm_scan_ros.core.types import AXES, Array, Trace


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


@define
class TrackingMeter:
    """Compares the achieved with the desired displacement; ``tracking`` gives the figures so far.

    ``displacement`` names what is compared: ``measured`` or ``true``.
    """

    spec: ScanSpec
    displacement: str = "measured"
    _samples: int = 0
    _sums: defaultdict[tuple[str, str], ErrorSum] = field(factory=lambda: defaultdict(ErrorSum))
    _lowest: dict[str, float] = field(factory=lambda: dict.fromkeys(AXES, np.inf))
    _highest: dict[str, float] = field(factory=lambda: dict.fromkeys(AXES, -np.inf))
    _lines: LineMeter = field(init=False)

    def __attrs_post_init__(self) -> None:
        self._lines = LineMeter(self.spec)
        nothing = Trace(0, self.spec.sample_period, np.empty(0), np.empty(0))
        self.add(nothing, nothing)  # so that every set is there, if empty

    def add(self, desired: Trace, achieved: Trace) -> None:
        """Take the next run of samples, the same of both; runs follow each other from sample 0."""
        sets = _sets(self.spec, desired)
        for axis in AXES:
            error = achieved.axis(axis) - desired.axis(axis)
            for name, mask in sets.items():
                self._sums[axis, name] = self._sums[axis, name].plus(error[mask])
            self._extend_range(axis, desired)
        if self.spec.pattern in TO_AND_FRO:
            self._lines.add(desired, achieved)
        self._samples += desired.x.size

    def tracking(self) -> Tracking:
        """Return the figures of all samples so far."""
        each_x, each_y = self._lines.repeatability()
        return Tracking(
            displacement=self.displacement,
            samples=self._samples,
            lines=self._whole_lines(),
            x=self._axis("x", each_x),
            y=self._axis("y", each_y),
            mismatch=self._lines.mismatch.figure(self._full("x")),
        )

    def _whole_lines(self) -> int:
        where = phases(self.spec).lines
        inside = min(max(self._samples, where.start), where.stop) - where.start
        return inside // self.spec.samples_per_line

    def _extend_range(self, axis: str, desired: Trace) -> None:
        where = phases(self.spec).lines
        start, stop = (max(0, edge - desired.first_sample) for edge in (where.start, where.stop))
        values = desired.axis(axis)[start:stop]
        self._lowest[axis] = min(self._lowest[axis], values.min(initial=np.inf))
        self._highest[axis] = max(self._highest[axis], values.max(initial=-np.inf))

    def _full(self, axis: str) -> float:
        """Return the desired peak-to-peak, m; of the specification as long as no line has begun."""
        full = float(self._highest[axis] - self._lowest[axis])
        planned = {"x": self.spec.range_x, "y": self.spec.range_y}[axis]
        return full if np.isfinite(full) and full > 0.0 else planned

    def _axis(self, axis: str, repeatability: float | None) -> AxisError:
        full = self._full(axis)
        figures = {
            name: error_sum.figure(full)
            for (of, name), error_sum in self._sums.items()
            if of == axis
        }
        return AxisError(peak_to_peak=full, repeatability=repeatability, **figures)


def _sets(spec: ScanSpec, run: Trace) -> dict[str, NDArray[np.bool_]]:
    """Return the samples of a run that each figure is made of."""
    kinds = sample_kinds(spec, run.first_sample, run.x.size)
    where = phases(spec)
    samples = np.arange(run.first_sample, run.first_sample + run.x.size)
    counted = kinds.line >= 1
    return {
        "all": counted,
        "constant_speed": counted & (kinds.trace | kinds.retrace),
        "turnarounds": counted & kinds.turnaround,
        "trace": counted & kinds.trace,
        "step": counted & kinds.y_step,
        "first_line": kinds.line == 0,
        "approach": (samples >= where.approach.start) & (samples < where.approach.stop),
        "preparation": samples < where.preparation.stop,
    }
