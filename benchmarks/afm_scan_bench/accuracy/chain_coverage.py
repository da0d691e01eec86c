"""How often the truth lies within its 95 % interval when the whole chain is identified.

Scanners drawn afresh, all effects at work and one mode more than the model has, are calibrated and
identified as the commands do it. Only the product of F and G(0) is seen, so the true gain over the
gauge is that at which the scanner travels as far as the model predicts. Where creep is found to be
of another order than the scanner's, none of it is inside.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.accuracy.coverage import with_bounds
from afm_scan_bench.accuracy.intervals.vibration import true_figures
from afm_scan_bench.accuracy.vibration import travel
from afm_scan_bench.draw import drawn
from afm_scan_bench.in_process import calibrate_in_process
from afm_scan_bench.scans import default_plant
from afm_scan_ros.core.identification.alternating import REFERENCE_GAIN
from afm_scan_ros.core.identification.creep.fit import CreepFit
from afm_scan_ros.core.identification.identify import (
    REQUIRED,
    AxisIdentification,
    identify_records,
)
from afm_scan_ros.core.least_squares import Interval
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.axis import AxisSpec, series

PLANTS = 20
NOWHERE = (np.nan, np.nan)
"""Interval of a parameter that the model does not have."""

COLUMNS = {
    "parameter": ("parameter", ""),
    "seeds": ("axes", "d"),
    "error_percent": ("error rms, %", ".4f"),
    "half_percent": ("± 95 %, %", ".4f"),
    "inside_percent": ("inside, %", ".1f"),
    "lowest_percent": ("at least, %", ".1f"),
    "highest_percent": ("at most, %", ".1f"),
}


def measure() -> Table:
    """Identify both axes of 20 scanners."""
    title = "Whole chain, scanners drawn afresh: 95 % intervals that hold the truth"
    rows = [with_bounds(row) for row in coverage(range(PLANTS))]
    return Table("chain_coverage", title, COLUMNS, rows)


def coverage(seeds: Iterable[int]) -> list[Row]:
    """Share of axes whose 95 % interval holds the truth, a row for each parameter."""
    found: dict[str, list[CoverageComparison]] = {}
    for figures in (figures for seed in seeds for figures in _scanner(seed)):
        for name, compared in figures:
            found.setdefault(name, []).append(compared)
    return [_row(name, compared) for name, compared in found.items()]


@frozen
class CoverageComparison:
    """A parameter of a scanner beside what was found, in any unit."""

    true: float
    found: float
    interval: Interval

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth; one that is not there holds nothing."""
        return self.interval[0] <= self.true <= self.interval[1]


def _scanner(seed: int) -> Iterator[Iterator[tuple[str, CoverageComparison]]]:
    """Figures of each axis of a scanner that a seed draws."""
    plant = drawn(default_plant(), np.random.default_rng(seed))
    records = calibrate_in_process(plant, seed)
    identified = identify_records([evolve(records[kind], kind=kind) for kind in REQUIRED])
    for axis, found in identified.axes.items():
        yield _vibration(plant.axes()[axis], found, plant.sensor_sensitivity)
        yield _creep(plant.axes()[axis], found.report.creep)


def _vibration(
    spec: AxisSpec, found: AxisIdentification, sensitivity: float
) -> Iterator[tuple[str, CoverageComparison]]:
    true, fit = true_figures(spec, sensitivity), found.report.vibration
    gain = travel(spec, found) / (REFERENCE_GAIN * found.report.effective_range)
    yield "gain at rest", CoverageComparison(gain, fit.gain_ratio, fit.gain_interval)
    yield "resonance", CoverageComparison(true["resonance"], fit.resonance, fit.resonance_interval)
    yield "damping", CoverageComparison(true["damping"], fit.damping, fit.damping_interval)


def _creep(spec: AxisSpec, fit: CreepFit) -> Iterator[tuple[str, CoverageComparison]]:
    gains, constants = (each[::-1] for each in series(spec.creep))
    right = fit.order == len(gains)
    for kind, true, fitted in (
        ("gain", gains, fit.model.gains),
        ("time_constant", constants, fit.model.time_constants),
    ):
        for number, value in enumerate(true, start=1):
            name = f"{kind}_{number}"
            one = CoverageComparison(value, value, NOWHERE)
            if right:
                one = CoverageComparison(value, fitted[number - 1], fit.intervals[name])
            yield f"creep {kind.split('_')[0]} {number}", one


def _row(name: str, compared: Sequence[CoverageComparison]) -> Row:
    true = np.array([one.true for one in compared])
    errors = np.array([one.found for one in compared]) / true - 1.0
    low, high = np.array([one.interval for one in compared]).T
    return {
        "parameter": name,
        "seeds": len(compared),
        "error_percent": 100.0 * float(np.sqrt(np.mean(errors**2))),
        "half_percent": 50.0 * float(np.nanmedian((high - low) / true)),
        "inside_percent": 100.0 * float(np.mean([one.inside for one in compared])),
    }
