"""How near an adapted reference comes to an inverse designed anew, where the shift is known."""

import numpy as np
from attrs import evolve

from afm_scan_bench.detune import detuned
from afm_scan_bench.scans import ALL, SEED, default_model, default_plant, relative_error, spec_at
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.features.online.adapted_reference import AxisShift, ReferenceFilter, with_shift
from afm_scan_ros.report.table import Table
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

LINE_RATES = 30.0, 100.0
SHIFTS = (AxisShift(frequency=0.97), AxisShift(frequency=1.03), AxisShift(1.0, 1.03, 1.5))

COLUMNS = {
    "line_rate_hz": ("line rate, Hz", ".0f"),
    "frequency_percent": ("resonance off by, %", "+.0f"),
    "damping_percent": ("its damping off by, %", "+.0f"),
    "model_percent": ("x rms at constant speed with the model's inverse, %", ".3f"),
    "adapted_percent": ("with the adapted reference, %", ".3f"),
    "redesigned_percent": ("with the inverse designed anew, %", ".3f"),
}


def measure() -> Table:
    """Scan plants whose first resonance is off by a known shift."""
    rows = []
    for rate in LINE_RATES:
        spec = spec_at(rate)
        target = desired(spec, 0, total_samples(spec))
        for shift in SHIFTS:
            plant = detuned(default_plant(), shift.frequency, shift.damping)
            model = default_model()
            anew = {name: with_shift(model.axis(name), shift) for name in AXES}
            rows.append(
                {
                    "line_rate_hz": rate,
                    "frequency_percent": 100.0 * (shift.frequency - 1.0),
                    "damping_percent": 100.0 * (shift.damping - 1.0),
                    "model_percent": _error(spec, plant, model, target),
                    "adapted_percent": _error(spec, plant, model, _adapted(target, shift)),
                    "redesigned_percent": _error(spec, plant, evolve(model, **anew), target),
                }
            )
    title = "An adapted reference against an inverse designed anew"
    return Table("adapted_inverse", title, COLUMNS, rows)


def _adapted(target: Trace, shift: AxisShift) -> Trace:
    """Reference of a whole scan of a scanner with a shift."""
    weights = np.repeat(shift.weights[:, None], len(target.x), axis=1)
    adapted = {}
    for name in AXES:
        filtered = ReferenceFilter(default_model().axis(name), target.sample_period)
        adapted[name] = filtered.apply(filtered.at_rest(), target.axis(name), weights)[1]
    return Trace(0, target.sample_period, **adapted)


def _error(spec: ScanSpec, plant: PlantSpec, model: ScannerModel, reference: Trace) -> float:
    """Rms error of x at constant speed, in % of its range, on the path of a reference."""
    period, limits = spec.sample_period, plant.amplifier.limits
    drive = Compensation(model, period, ALL, InverseSettings(), limits).whole(reference)
    _, true = Piezoscanner(plant, period, SEED).advance(drive)
    return 100.0 * relative_error(spec, desired(spec, 0, len(true.x)).x, true.x)
