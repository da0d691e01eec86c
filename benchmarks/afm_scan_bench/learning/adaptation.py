"""The error at constant speed, minute by minute, of a scan during which the resonance drifts.

The load on x changes evenly over the scan. The scan is made in process, in blocks of ``BLOCK``
lines. What a block shows is in force from the next block but one on.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.curve import TableCurve
from afm_scan_bench.scans import ALL, SEED, default_model, default_plant, spec_at
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DRIVE, Aligner, end
from afm_scan_ros.core.trajectory import desired, phases, sample_kinds
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.online.adaptation import TIME_CONSTANT, Adaptation
from afm_scan_ros.features.online.adapted_scan import AdaptedScan
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.mechanisms.environment import ChangingLoad
from afm_scan_ros.simulation.scanner import Piezoscanner

MINUTES = 10
DRIFT = 0.03
"""Share of the resonance's frequency, over the scan."""
LINE_RATE = 100.0
BLOCK = 10
"""Lines that are driven at once."""

COLUMNS = {
    "minute": ("minute", ".0f"),
    "adaptation": ("adaptation", ""),
    "x_rms_percent": ("x rms at constant speed, %", ".3f"),
    "x_worst_line_percent": ("worst line, %", ".3f"),
    "resonance_percent": ("resonance moved by, %", "+.2f"),
    "tracked_percent": ("tracked, %", "+.2f"),
}


def drifting(spec: ScanSpec, drift: float) -> Piezoscanner:
    """Scanner whose first resonance in x moves by a share over the scan, as its load changes."""
    load = ChangingLoad(
        axis="x",
        mass_ratio_before=0.0,
        mass_ratio_after=(1.0 + drift) ** -2 - 1.0,
        begin=0.0,
        end=spec.sample_period * phases(spec).lines.stop,
    )
    plant = evolve(default_plant(), mechanisms=(load,))
    return Piezoscanner(plant, spec.sample_period, SEED)


@frozen(eq=False)
class Tracked:
    """Rms error (m) of x at constant speed on each line, and its resonance's tracked factor."""

    error: Array
    frequency: Array


def tracked(spec: ScanSpec, drift: float, *, adapt: bool, memory: float = TIME_CONSTANT) -> Tracked:
    """Scan a scanner whose resonance drifts, with or without adaptation of some memory (s)."""
    model, scanner = default_model(), drifting(spec, drift)
    limits, settings = default_plant().amplifier.limits, InverseSettings()
    compensation = Compensation(model, spec.sample_period, ALL, settings, limits)
    adaptation = Adaptation(model, spec, memory)
    adapted = AdaptedScan(model, spec, adaptation, 2 * BLOCK)
    where, progress = phases(spec), compensation.at_rest()
    meter, held = _LineErrors(spec), Aligner(("target", "true"))
    frequency = np.ones(spec.lines)
    size = BLOCK * spec.samples_per_line
    for first in range(0, where.total, size):
        target = desired(spec, first, min(size, where.total - first))
        held.add("target", target)
        reference = _joined(adapted.corrected([target])) if adapt else target
        progress, drive = compensation.invert(progress, reference)
        drives = [drive]
        if end(target) == where.total:
            drives.append(compensation.finish(progress))
        for drive in (each for each in drives if len(each.x)):
            measured, true = scanner.advance(drive)
            held.add("true", true)
            if adapt:
                adapted.observe(DRIVE, drive)
                adapted.observe(ACHIEVED, measured)  # no block waits for it
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
        share, mass = last / spec.lines, (1.0 + DRIFT) ** -2 - 1.0
        yield {
            "minute": last / size,
            "adaptation": "on" if adapt else "off",
            "x_rms_percent": float(np.sqrt(np.mean(percent[lines] ** 2))),
            "x_worst_line_percent": float(percent[lines].max()),
            "resonance_percent": 100.0 * ((1.0 + share * mass) ** -0.5 - 1.0),
            "tracked_percent": 100.0 * (float(found.frequency[last - 1]) - 1.0),
        }
