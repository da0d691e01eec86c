"""One record of random levels joined by ever faster ramps, alone: 12 s of an unknown scanner.

Each scanner begins at depolarised rest, which its record states. The error is that of triangles
that no record has, of a fresh scanner, against the true displacement, from the second cycle on.
"""

import time

import numpy as np
from scipy import signal

import afm_scan_ros as afm
from afm_scan_bench.families.operators import LIMIT
from afm_scan_bench.families.scanners import FAMILIES, FamilyScanner
from afm_scan_ros.core.identification.drives.excitation import excitation_block, validation_plan
from afm_scan_ros.core.identification.identify import identify_axis
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

RECORDED, SCANNED = 21, 22
"""Seeds of the sensor's noise."""
RATE = 20e3
"""Hz, of the scans."""
SCANS = {"slow": (2.0, 0.6), "small": (15.0, 0.2), "fast": (50.0, 0.6)}
"""Triangles: cycles a second, and share of the drive's range."""

COLUMNS = {
    "family": ("hysteresis", ""),
    "operator": ("operator", ""),
    **{name: (f"{name} scan, % of its range", ".4f") for name in SCANS},
    "gain": ("largest error of the gain, %", ".3f"),
    "offset_nm": ("largest offset, nm", ".0f"),
    "stated": ("stated for a whole scan, %", ".4f"),
    "seconds": ("CPU s", ".0f"),
}


def measure() -> Table:
    """Fit each family's record, and predict scans."""
    rows = [case(family) for family in FAMILIES]
    title = "Scans predicted by the fit of 12 s of random levels"
    return Table("random_levels", title, COLUMNS, rows)


def case(family: str) -> Row:
    """One family, with a cube behind its operator."""
    scanner = FamilyScanner.of(family, "cube behind")
    plan = validation_plan()
    drive = excitation_block(plan, 0, plan.total_samples).x
    measured, _ = scanner.displacement(drive, plan.sample_period, RECORDED)
    record = afm.Record(drive, measured, plan.sample_period, start="depolarised")
    begun = time.process_time()
    found = identify_axis([record], "x")
    seconds = time.process_time() - begun
    model = afm.Model(ScannerModel(x=found.model), "random levels alone")
    errors = {name: _errors(scanner, model, *scan) for name, scan in SCANS.items()}
    return {
        "family": family,
        "operator": found.operator,
        **{name: each[0] for name, each in errors.items()},
        "gain": max((each[1] for each in errors.values()), key=abs),
        "offset_nm": max((each[2] for each in errors.values()), key=abs),
        "stated": 100.0 * found.deviation,
        "seconds": seconds,
    }


def _errors(
    scanner: FamilyScanner, model: afm.Model, rate: float, share: float
) -> tuple[float, float, float]:
    """Standard deviation (% of the range), gain (%) and offset (nm) of a prediction's error."""
    drive = _triangles(rate, share * LIMIT)
    true = scanner.displacement(drive, 1.0 / RATE, SCANNED)[1]
    counts = slice(round(RATE / rate), None)
    moved, error = true[counts], (model.predict(drive, 1.0 / RATE) - true)[counts]
    left = 100.0 * float(np.std(error) / np.ptp(moved))
    return left, 100.0 * float(np.polyfit(moved, error, 1)[0]), 1e9 * float(error.mean())


def _triangles(rate: float, size: float) -> Array:
    seconds = np.arange(round(6.0 * RATE / rate)) / RATE
    return np.asarray(size * signal.sawtooth(2.0 * np.pi * (rate * seconds + 0.25), 0.5))
