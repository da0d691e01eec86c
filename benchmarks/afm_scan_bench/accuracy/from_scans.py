"""Models from ordinary triangle scans alone: what they predict, and how their inverse tracks.

The records are scans at two rates and two amplitudes. The test is a third of each.
"""

from collections.abc import Callable, Iterator

import numpy as np
from attrs import evolve
from scipy import signal

import afm_scan_ros as afm
from afm_scan_bench.families.operators import LIMIT
from afm_scan_bench.families.scanners import FAMILIES, FamilyScanner
from afm_scan_bench.scans import SEED, rms_percent, spec_at, tracking
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.report.table import Row, Table

PERIOD, CYCLES = 1e-4, 4
RATES, SIZES = (1.0, 10.0), (0.9, 0.4)
"""Hz, and shares of the drive's limit, of the records."""
TEST_RATE, TEST_SIZE = 5.0, 0.65
MAPS = "none", "square before, cube behind"

COLUMNS = {
    "family": ("family", ""),
    "maps": ("maps", ""),
    "prediction_percent": ("prediction, rms, % of range", ".2f"),
    "inverse_percent": ("by the inverse, rms, % of range", ".2f"),
    "gain_percent": ("by one gain", ".2f"),
    "ratio": ("one gain over the inverse", ".1f"),
}


def measure() -> Table:
    """Identify each family from four records, predict a fresh scan and track another."""
    rows = [row_of(family, maps) for family in FAMILIES for maps in MAPS]
    title = "Models from scans at two rates and two amplitudes: a third of each"
    return Table("from_scans", title, COLUMNS, rows)


def row_of(family: str, maps: str) -> Row:
    """Errors of one scanner."""
    scanner = FamilyScanner.of(family, maps)
    records = list(_records(scanner))
    model = afm.identify(records)
    drive = _triangles(TEST_SIZE, TEST_RATE)
    _, true = scanner.displacement(drive, PERIOD, SEED)
    residual = model.predict(drive, PERIOD) - true
    inverse = _tracked(scanner, model.invert)
    gain = _gain(records)
    by_gain = _tracked(scanner, lambda path, _: path / gain)
    return {
        "family": family,
        "maps": maps,
        "prediction_percent": 100.0 * float(np.std(residual) / np.ptp(true)),
        "inverse_percent": inverse,
        "gain_percent": by_gain,
        "ratio": by_gain / inverse,
    }


def _triangles(size: float, rate: float) -> Array:
    """Triangles of a share of the limit (V), from zero to zero."""
    turns = 2.0 * np.pi * rate * PERIOD * np.arange(round(CYCLES / (rate * PERIOD)))
    return np.asarray(size * LIMIT * signal.sawtooth(turns + 0.5 * np.pi, 0.5))


def _records(scanner: FamilyScanner) -> Iterator[afm.Record]:
    for size in SIZES:
        for rate in RATES:
            drive = _triangles(size, rate)
            measured, _ = scanner.displacement(drive, PERIOD, SEED)
            yield afm.Record(drive, measured, PERIOD, start="depolarised")


def _gain(records: list[afm.Record]) -> float:
    """Slope (m/V) of a straight line through all records."""
    drive = np.concatenate([r.drive[:, 0] - r.drive.mean() for r in records])
    moved = np.concatenate([r.displacement[:, 0] - r.displacement.mean() for r in records])
    return float(drive @ moved / (drive @ drive))


def _tracked(scanner: FamilyScanner, invert: Callable[[Array, float], Array]) -> float:
    """Rms error of x at constant speed, % of the scan, by a drive for its path (m, period in s)."""
    extent = TEST_SIZE * scanner.reach()
    spec = evolve(spec_at(TEST_RATE), range_x=extent, range_y=extent, preparation="none")
    target, period = desired(spec, 0, total_samples(spec)), spec.sample_period
    drive = invert(target.x, period)
    measured, true = scanner.displacement(drive, period, SEED)
    both = (Trace(0, period, each, each) for each in (drive, measured, true))
    return rms_percent(tracking(Scan(spec, target, *both)).x.constant_speed)
