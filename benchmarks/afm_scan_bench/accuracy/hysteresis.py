"""Inverse hysteresis on fresh records: exact inversion and the paper's direct inverse."""

import numpy as np

from afm_scan_bench.accuracy.effective_input import effective_input
from afm_scan_bench.accuracy.fresh_drives import FRESH, SAMPLE_RATE
from afm_scan_bench.scans import SEED, default_model, default_plant
from afm_scan_ros.core.effects.hysteresis.preisach import DirectInverse
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.scanner import Piezoscanner

RANGE = 8.0  # V, the identified range that the errors are shares of

COLUMNS = {
    "kind": ("drive", ""),
    "axis": ("axis", ""),
    "inverse": ("inverse", ""),
    "sigma_v": ("sigma, V (Eq. 18)", ".4f"),
    "max_v": ("max, V (Eq. 19)", ".4f"),
    "sigma_percent": ("sigma, % of range", ".3f"),
    "max_percent": ("max, % of range", ".3f"),
}


def measure() -> Table:
    """Predict the drive of held-out records from their displacement."""
    rows: list[Row] = [
        {"kind": kind, "axis": axis, "inverse": name, **errors(predicted - fresh.drive[:, 0])}
        for kind, records in fresh_records().items()
        for axis, fresh in records.items()
        for name, predicted in predictions(default_model().axis(axis), fresh).items()
    ]
    title = "Inverse hysteresis on fresh records from rest: drive predicted from displacement"
    return Table("hysteresis", title, COLUMNS, rows)


def fresh_records() -> dict[str, dict[str, Record]]:
    """Records of the default plant under each kind of fresh drive, by kind and axis."""
    rng = np.random.default_rng(SEED)
    return {kind: record(drive(rng)) for kind, drive in FRESH.items()}


def record(drive: Array) -> dict[str, Record]:
    """Record of the default plant, by axis; both are driven by ``drive`` (V), shape (n,)."""
    period = 1.0 / SAMPLE_RATE
    trace = Trace(0, period, drive, drive)
    measured, _ = Piezoscanner(default_plant(), period, SEED).advance(trace)
    return {axis: Record(drive, measured.axis(axis), period, (axis,)) for axis in AXES}


def predictions(model: AxisModel, fresh: Record) -> dict[str, Array]:
    """Drive, V, that each inverse predicts from the record freed of creep and vibration."""
    effective = effective_input(model, fresh.displacement[:, 0], fresh.sample_period)
    exact, direct = model.hysteresis.operator(), DirectInverse(model.hysteresis.direct)
    return {
        "exact": exact.invert(exact.inverse_at_rest(), effective)[1],
        "direct (the paper's)": direct.invert(direct.inverse_at_rest(), effective)[1],
    }


def errors(error: Array) -> dict[str, float]:
    """Figures of merit of a prediction, in V and in % of the identified range."""
    found = misfit(error)
    return {
        "sigma_v": found.sigma,
        "max_v": found.maximum,
        "sigma_percent": 100.0 * found.sigma / RANGE,
        "max_percent": 100.0 * found.maximum / RANGE,
    }
