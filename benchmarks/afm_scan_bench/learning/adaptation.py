"""The error at constant speed, minute by minute, of a scan during which the resonance drifts.

x and y drift by the same share of their frequency, evenly over the scan; both scans have the same
sensor noise. The scan is made in process, in blocks of ``BLOCK`` lines. What a block shows is in
force from the next block but one on.
"""

from collections import deque
from collections.abc import Iterable, Iterator

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.curve import TableCurve
from afm_scan_bench.detune import detuned
from afm_scan_bench.scans import ALL, SEED, default_model, default_plant, spec_at
from afm_scan_ros.core.align import Aligner, end
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.learning.adaptation import Adaptation
from afm_scan_ros.core.learning.adapted_scan import AdaptedScan
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, sample_kinds
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.chain import SimulatedChain
from afm_scan_ros.simulation.scanner import read

MINUTES = 10
DRIFT = 0.03
"""Share of the resonance's frequency, over the scan."""
LINE_RATE = 100.0
BLOCK = 10
"""Lines that are driven at once, at one resonance: it moves by 5e-6 from one to the next."""

COLUMNS = {
    "minute": ("minute", ".0f"),
    "adaptation": ("adaptation", ""),
    "x_rms_percent": ("x rms at constant speed, %", ".3f"),
    "x_worst_line_percent": ("worst line, %", ".3f"),
    "resonance_percent": ("resonance moved by, %", "+.2f"),
    "tracked_percent": ("tracked, %", "+.2f"),
}


class DriftingScanner:
    """A simulated scanner whose first resonance moves with time; each block has its own."""

    def __init__(self, spec: ScanSpec, drift: float) -> None:
        self._plant, self._drift = default_plant(), drift
        self._lines, self._period = phases(spec).lines, spec.sample_period
        self._rng = np.random.default_rng(SEED)
        self._states = SimulatedChain(self._plant, self._period).at_rest(self._rng)
        self._before = {"x": 0.0, "y": 0.0}

    @property
    def limits(self) -> DriveLimits:
        """What the amplifier refuses to exceed."""
        return self._plant.amplifier.limits

    def share(self, sample: int) -> float:
        """Change of the resonance's frequency by a sample."""
        done = (sample - self._lines.start) / len(self._lines)
        return self._drift * min(max(done, 0.0), 1.0)

    def advance(self, drive: Trace) -> tuple[Trace, Trace]:
        """Measured and true displacement, m, of the next block of drive, V."""
        self.limits.refuse_beyond(drive, self._before)
        plant = detuned(self._plant, 1.0 + self.share(drive.first_sample), 1.0)
        self._states, true = SimulatedChain(plant, self._period).advance(self._states, drive)
        self._before = {name: float(drive.axis(name)[-1]) for name in self._before}
        return read(plant.sensor, true, self._rng), true


@frozen(eq=False)
class Tracked:
    """Rms error (m) of x at constant speed on each line, and its resonance's tracked factor."""

    error: Array
    frequency: Array


def tracked(spec: ScanSpec, drift: float, *, adapt: bool) -> Tracked:
    """Scan a scanner whose resonance drifts, with or without adaptation."""
    model, scanner = default_model(), DriftingScanner(spec, drift)
    settings = InverseSettings()
    compensation = Compensation(model, spec.sample_period, ALL, settings, scanner.limits)
    adaptation = Adaptation(model, spec)
    adapted = AdaptedScan(model, spec, adaptation, 2 * BLOCK)
    where, progress = phases(spec), compensation.at_rest()
    meter, held = _LineErrors(spec), Aligner(("target", "true"))
    frequency = np.ones(spec.lines)
    size = BLOCK * spec.samples_per_line
    for first in range(0, where.total, size):
        target = desired(spec, first, min(size, where.total - first))
        held.add("target", target)
        reference = _joined(adapted.desired(target)) if adapt else target
        progress, drive = compensation.invert(progress, reference)
        drives = [drive]
        if end(target) == where.total:
            drives.append(compensation.finish(progress))
        for drive in (each for each in drives if len(each.x)):
            measured, true = scanner.advance(drive)
            held.add("true", true)
            if adapt:
                adapted.driven(drive)
                deque(adapted.achieved(measured), maxlen=0)  # no block waits for it
        meter.add(held)
        at = slice(max(0, (first - where.lines.start) // spec.samples_per_line), None)
        frequency[at] = adaptation.states["x"].shift.frequency
    return Tracked(meter.errors, frequency)


def _joined(parts: Iterable[Trace]) -> Trace:
    """Return consecutive runs as one."""
    runs = list(parts)
    x, y = (np.concatenate([run.axis(name) for run in runs]) for name in AXES)
    return Trace(runs[0].first_sample, runs[0].sample_period, x, y)


class _LineErrors:
    """Gathers the error of x at constant speed, line by line."""

    def __init__(self, spec: ScanSpec) -> None:
        self._spec, self._lines = spec, phases(spec).lines
        self._squares, self._counts = np.zeros(spec.lines), np.zeros(spec.lines)

    def add(self, held: Aligner) -> None:
        """Take what both streams have."""
        for target, true in held.ready():
            kinds = sample_kinds(self._spec, target.first_sample, len(target.x))
            steady = kinds.trace | kinds.retrace
            square = (true.x - target.x)[steady] ** 2
            np.add.at(self._squares, kinds.line[steady], square)
            np.add.at(self._counts, kinds.line[steady], 1.0)

    @property
    def errors(self) -> Array:
        """Rms error of each line, m."""
        return np.sqrt(self._squares / self._counts)


def spec_of(minutes: float) -> ScanSpec:
    """Scan of so many minutes."""
    return evolve(spec_at(LINE_RATE), lines=round(60.0 * LINE_RATE * minutes))


def measure() -> Table:
    """Scan with and without adaptation."""
    rows: list[Row] = []
    for adapt in (False, True):
        spec = spec_of(MINUTES)
        rows += _minutes(spec, tracked(spec, DRIFT, adapt=adapt), adapt=adapt)
    title = (
        f"A scan of {MINUTES} minutes at {LINE_RATE:g} lines a second, the resonance drifting by"
        f" {100 * DRIFT:g} %"
    )
    curve = TableCurve("minute", "x_rms_percent", by="adaptation")
    return Table("adaptation", title, COLUMNS, rows, curve.picture(title, COLUMNS, rows))


def _minutes(spec: ScanSpec, found: Tracked, *, adapt: bool) -> Iterator[Row]:
    """One row for each minute; the first line is left out."""
    percent = 100.0 * found.error / spec.range_x
    size = round(60.0 * LINE_RATE)
    for first in range(0, spec.lines, size):
        lines = slice(max(first, 1), first + size)
        last = min(first + size, spec.lines)
        yield {
            "minute": last / size,
            "adaptation": "on" if adapt else "off",
            "x_rms_percent": float(np.sqrt(np.mean(percent[lines] ** 2))),
            "x_worst_line_percent": float(percent[lines].max()),
            "resonance_percent": 100.0 * DRIFT * last / spec.lines,
            "tracked_percent": 100.0 * (float(found.frequency[last - 1]) - 1.0),
        }
