"""How well the vibration is recovered from a scanner whose hysteresis is at work all the while.

The split between F and G(0) is a convention, so gains are compared as products. The model's gain
at rest is that of the fitted response times the model's F, for each volt of the plant's own F
over the frequency record. The travel is G(0) times the range of F between the drive's limits.
The plant's gain at rest includes its further mode, and not its creep.
Beside it: resonance and damping of the response to the drive u at zero amplitude, extrapolated
from weaker and weaker waves without any model of the hysteresis. No interval is given for these:
it would not hold how far the straight line itself is from the law.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_bench.accuracy.intervals.vibration import true_figures
from afm_scan_bench.in_process import calibrate_in_process
from afm_scan_bench.scans import SEED, default_plant
from afm_scan_ros.core.identification.alternating import REFERENCE_GAIN
from afm_scan_ros.core.identification.identify import (
    REQUIRED,
    AxisIdentification,
    identify_records,
)
from afm_scan_ros.core.least_squares import Interval
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.axis import AxisSpec, Dynamics, PlayBank, RationalSpec

COLUMNS = {
    "axis": ("axis", ""),
    "figure": ("figure", ""),
    "true": ("of the plant", ".6g"),
    "found": ("recovered", ".6g"),
    "error_percent": ("error, %", "+.4f"),
    "interval_percent": ("95 % interval, %", ""),
    "target_percent": ("target, %", ""),
}
MICRO = 1e6


def measure() -> Table:
    """Calibrate and identify the default plant, and compare with its polynomials."""
    records = calibrate_in_process(default_plant(), SEED)
    found = identify_records([evolve(records[kind], kind=kind) for kind in REQUIRED])
    rows = [
        {"axis": axis, **row}
        for axis in AXES
        for row in figures(
            default_plant().axes()[axis],
            found.axes[axis],
            records["frequency"].signals(axis)[0],
        )
    ]
    return Table("vibration", "Vibration recovered from the default plant", COLUMNS, rows)


def figures(spec: AxisSpec, found: AxisIdentification, drive: Array) -> Iterator[Row]:
    """Resonance, damping, gain and travel of one axis; ``drive`` (V, (n,)) is the multisines'."""
    truth = true_figures(spec, default_plant().sensor_sensitivity)
    fit, static = found.report.vibration, static_gain(spec)
    each = MICRO * REFERENCE_GAIN * effective_per_volt(spec, found, drive)
    low, high = fit.gain_interval
    yield _row("resonance, Hz", truth["resonance"], fit.resonance, fit.resonance_interval, 0.005)
    yield _row("damping ratio", truth["damping"], fit.damping, fit.damping_interval, 0.3)
    gain = (each * low, each * high)
    yield _row("gain at rest, µm/V", MICRO * static, each * fit.gain_ratio, gain, 0.2)
    reached = MICRO * REFERENCE_GAIN * found.report.effective_range
    yield _row("travel, µm", MICRO * travel(spec, found), reached, None, 0.2)
    zero = found.report.checks.at_zero
    if zero is not None:
        yield _row("resonance at 0 V, Hz", truth["resonance"], zero.resonance, None, None)
        yield _row("damping ratio at 0 V", truth["damping"], zero.damping, None, None)


def static_gain(spec: AxisSpec) -> float:
    """Gain at rest of the plant's polynomials and modes, without creep, m/V."""
    rigid = evolve(spec, creep=RationalSpec((1.0,), (1.0,)))
    dynamics = Dynamics.from_spec(rigid, default_plant().sensor_sensitivity)
    return float(dynamics.response(np.zeros(1))[0].real)


def travel(spec: AxisSpec, found: AxisIdentification) -> float:
    """How far the plant goes between the model's saturations, without creep, m."""
    surface, plays = found.model.hysteresis.forward, PlayBank.from_spec(spec.hysteresis)
    ends = np.array([surface.lower, surface.upper, surface.lower])
    return static_gain(spec) * float(np.ptp(plays.apply(plays.relaxed(), ends)[1]))


def effective_per_volt(spec: AxisSpec, found: AxisIdentification, drive: Array) -> float:
    """Model's F for each volt of the plant's F, by least squares over a drive (V) from rest."""
    model, plays = found.model.hysteresis.operator(), PlayBank.from_spec(spec.hysteresis)
    believed: Array = model.apply(model.at_rest(), drive)[1]
    true = plays.apply(plays.relaxed(), drive)[1]
    return float(np.polyfit(true, believed, 1)[0])


def _row(
    figure: str, true: float, found: float, interval: Interval | None, target: float | None
) -> Row:
    return {
        "figure": figure,
        "true": true,
        "found": found,
        "error_percent": 100.0 * (found / true - 1.0),
        "interval_percent": "" if interval is None else _errors(interval, true),
        "target_percent": "" if target is None else f"{target:.3f}",
    }


def _errors(interval: Interval, true: float) -> str:
    """Errors that the ends of an interval would be, %: of unlike sign where it holds the truth."""
    low, high = (f"{100.0 * (end / true - 1.0):+.4f}" for end in interval)
    return f"{low}, {high}"
