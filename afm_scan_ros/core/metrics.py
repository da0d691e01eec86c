"""Figures of merit of a scan, gathered block by block in constant memory.

The error is achieved minus desired displacement at the same sample, the desired one as it was
published, with no delay, gain or offset fitted. Its rms is about zero. Figures are in SI units;
``plain`` names their units where they leave the package.

Some figures need whole lines: trace against retrace, and one line against the next.
"""

from collections import defaultdict
from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np
from attrs import AttrsInstance, define, field, fields, frozen, has
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import LARGEST_RANGE, ScanSpec
from afm_scan_ros.core.streams import WholeLines
from afm_scan_ros.core.trajectory import TO_AND_FRO, phases, sample_kinds
from afm_scan_ros.core.types import AXES, Array, Trace

METRES = {"unit": "m"}


@frozen
class Figure:
    """An error over a set of samples: rms and largest, in m and as a share of the planned range."""

    rms: float = field(metadata=METRES)
    largest: float = field(metadata=METRES)
    rms_share: float
    largest_share: float
    samples: int


@frozen
class ErrorSplit:
    """The straight line of an error against the desired position, and what it leaves.

    ``offset`` is the line at the scan's centre, ``gain`` its slope, and ``shape`` the rms of what
    remains, in m and as a share of the planned range. An image shows them differently.
    """

    offset: float = field(metadata=METRES)
    gain: float
    shape: float = field(metadata=METRES)
    shape_share: float


@frozen
class AxisError:
    """The error of one axis. Sets that hold no sample are None.

    ``planned_range`` is the specification's, of which the figures state shares, ``peak_to_peak``
    what the desired displacement spans on the lines so far.
    ``all``, ``constant_speed`` and ``turnarounds`` leave out the first to-and-fro, which stands
    in ``first_line`` alone; so do ``trace`` (the constant-speed part of all traces) and ``step``
    (the smooth steps of y). ``approach`` and ``preparation`` come before the lines. ``split`` is
    that of ``constant_speed`` in x and of ``trace`` in y, None where these hold one position.
    """

    planned_range: float = field(metadata=METRES)
    peak_to_peak: float = field(metadata=METRES)
    all: Figure | None
    constant_speed: Figure | None
    turnarounds: Figure | None
    trace: Figure | None
    step: Figure | None
    first_line: Figure | None
    approach: Figure | None
    preparation: Figure | None
    split: ErrorSplit | None
    repeatability: float | None = field(metadata=METRES)


@frozen
class Tracking:
    """The figures of one scan, of its ``measured`` or its ``true`` (noise-free) displacement.

    ``mismatch`` is the difference of x between trace and retrace at equal desired position, of
    all lines but the first. ``repeatability`` of each axis is what differs from line to line: the
    rms difference of successive lines' errors about its mean, divided by the square root of two.
    """

    displacement: str
    samples: int
    lines: int
    x: AxisError
    y: AxisError
    mismatch: Figure | None


def plain(record: AttrsInstance) -> dict[str, Any]:
    """Return a record as JSON has it: its numbers in SI units, each unit in the number's name."""
    result: dict[str, Any] = {}
    for attribute in fields(type(record)):
        unit = attribute.metadata.get("unit")
        name = f"{attribute.name}_{unit}" if unit else attribute.name
        result[name] = _plain_value(getattr(record, attribute.name))
    return result


def _plain_value(value: Any) -> Any:  # noqa: ANN401 - whatever JSON can hold
    if has(type(value)):
        return plain(value)
    if isinstance(value, Mapping):
        return {str(key): _plain_value(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain_value(each) for each in value]
    return value


@frozen
class ErrorSum:
    """How many errors there were, the sum of their squares, and the largest."""

    count: int = 0
    squares: float = 0.0
    largest: float = 0.0

    def plus(self, error: Array) -> "ErrorSum":
        """Return the sums with the errors of shape (n,) added."""
        if not error.size:
            return self
        largest = max(self.largest, float(np.abs(error).max()))
        return ErrorSum(self.count + error.size, self.squares + float(error @ error), largest)

    def rms(self) -> float:
        """Root of the mean square about zero; there must be samples."""
        return sqrt(self.squares / self.count)

    def figure(self, full: float) -> Figure | None:
        """Return the figures for an axis of the planned range ``full``; None without samples."""
        if not self.count:
            return None
        rms = self.rms()
        return Figure(rms, self.largest, rms / full, self.largest / full, self.count)


@frozen(eq=False)
class LineSum:
    """Products of 1, the position from the centre over the range, and the error, summed."""

    products: Array = field(factory=lambda: np.zeros((3, 3)))

    def plus(self, position: Array, error: Array) -> "LineSum":
        """Return the sums with samples added, both of shape (n,)."""
        rows = np.stack([np.ones_like(error), position, error])
        return LineSum(self.products + rows @ rows.T)

    def split(self, full: float) -> ErrorSplit | None:
        """Return offset, gain and shape for an axis of the planned range ``full``, m."""
        matrix, right, squares = self.products[:2, :2], self.products[:2, 2], self.products[2, 2]
        if np.linalg.matrix_rank(matrix) < len(matrix):
            return None
        line = np.linalg.solve(matrix, right)
        shape = float(np.sqrt(max(squares - right @ line, 0.0) / matrix[0, 0]))
        return ErrorSplit(float(line[0]), float(line[1]) / full, shape, shape / full)


SPLIT = {"x": "constant_speed", "y": "trace"}
"""The set of each axis whose error is split."""


@define
class LineMeter:
    """Compares the lines of a to-and-fro scan, in constant memory."""

    spec: ScanSpec
    mismatch: ErrorSum = field(factory=ErrorSum)
    _jitter: list[ErrorSum] = field(factory=lambda: [ErrorSum() for _ in AXES])
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
        x, y = (total.rms() / sqrt(2.0) if total.count else None for total in self._jitter)
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
            self._jitter = [s.plus(row) for s, row in zip(self._jitter, change, strict=True)]
        self._before = errors.copy()


@define
class TrackingMeter:
    """Compares the achieved with the desired displacement; ``tracking`` has the figures so far."""

    spec: ScanSpec
    displacement: str = "measured"
    _samples: int = 0
    _sums: defaultdict[tuple[str, str], ErrorSum] = field(factory=lambda: defaultdict(ErrorSum))
    _lowest: dict[str, float] = field(factory=lambda: dict.fromkeys(AXES, np.inf))
    _highest: dict[str, float] = field(factory=lambda: dict.fromkeys(AXES, -np.inf))
    _straight: dict[str, LineSum] = field(factory=lambda: {axis: LineSum() for axis in AXES})
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
            counted, (centre, full) = sets[SPLIT[axis]], self.spec.extent(axis)
            position = (desired.axis(axis)[counted] - centre) / full
            self._straight[axis] = self._straight[axis].plus(position, error[counted])
            self._extend_range(axis, desired)
        if self.spec.pattern in TO_AND_FRO:
            self._lines.add(desired, achieved)
        self._samples += desired.x.size

    def tracking(self) -> Tracking:
        """Return the figures of all samples so far."""
        where = phases(self.spec).lines
        inside = min(max(self._samples, where.start), where.stop) - where.start
        each_x, each_y = self._lines.repeatability()
        return Tracking(
            displacement=self.displacement,
            samples=self._samples,
            lines=inside // self.spec.samples_per_line,
            x=self._axis("x", each_x),
            y=self._axis("y", each_y),
            mismatch=self._lines.mismatch.figure(self.spec.range_x),
        )

    def _extend_range(self, axis: str, desired: Trace) -> None:
        where = phases(self.spec).lines
        start, stop = (max(0, edge - desired.first_sample) for edge in (where.start, where.stop))
        values = desired.axis(axis)[start:stop]
        self._lowest[axis] = min(self._lowest[axis], values.min(initial=np.inf))
        self._highest[axis] = max(self._highest[axis], values.max(initial=-np.inf))

    def _axis(self, axis: str, repeatability: float | None) -> AxisError:
        _, planned = self.spec.extent(axis)
        figures = {
            name: error_sum.figure(planned)
            for (of, name), error_sum in self._sums.items()
            if of == axis
        }
        spanned = max(0.0, float(self._highest[axis] - self._lowest[axis]))
        split = self._straight[axis].split(planned)
        return AxisError(planned, spanned, split=split, repeatability=repeatability, **figures)


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


@frozen(eq=False)
class Scan:
    """All signals of a scan: displacements in m, drive in V, each of the scan's whole length.

    ``true``, the displacement without noise, is known of a simulated scanner alone.
    """

    spec: ScanSpec
    desired: Trace
    drive: Trace
    measured: Trace
    _true: Trace | None = None

    @property
    def knows_true(self) -> bool:
        """Whether the noise-free displacement is known."""
        return self._true is not None

    @property
    def true(self) -> Trace:
        """Return the noise-free displacement, m; raises InputError where it is not known."""
        if self._true is None:
            raise InputError("no noise-free displacement: only a simulated scanner knows it")
        return self._true

    def tracking(self, displacement: str) -> Tracking:
        """Figures of the ``measured`` or of the ``true``, noise-free, displacement."""
        meter = TrackingMeter(self.spec, displacement)
        meter.add(self.desired, self.true if displacement == "true" else self.measured)
        return meter.tracking()


def sensor_doubt(axis: str, moved: float, lowest: float, highest: float) -> str:
    """Return a sentence where an axis that is ``moved`` stands still, or goes too far (m)."""
    if moved > 0.0 and lowest == highest:
        return f"{axis}: the achieved displacement is constant: see that the sensor is connected"
    if highest - lowest > LARGEST_RANGE:
        return (
            f"{axis}: the achieved displacement spans {highest - lowest:.3g} m, a scanner's"
            f" {LARGEST_RANGE:g} m at most: see to the sensor's scale"
        )
    return ""
