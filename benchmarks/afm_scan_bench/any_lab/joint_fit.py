"""The fit of all records against ``identify``: fresh scans of scanners drawn at random.

Each scanner is of the family and its records of the protocol whose turn it is, as in ``any_lab``.
Both get the x axis of the same records. The error is against the true displacement of a triangle
over 0.6 of the driven range, at a rate that no record has.
"""

import time
from collections.abc import Callable, Sequence

import numpy as np
from attrs import frozen

import afm_scan_ros as afm
from afm_scan_bench.any_lab.protocols import PROTOCOLS, raised, taken
from afm_scan_bench.any_lab.scanner import DRAWN_FOR, FAMILIES, DrawnScanner, draw
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.model_of_fit import model_of
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

SEEDS = range(40)
COLUMNS = {
    "seed": ("seed", "d"),
    "protocol": ("records", ""),
    "family": ("hysteresis", ""),
    "line": ("one gain, % of range", ".2f"),
    "identify": ("identify", ".3f"),
    "identify_gain": ("its gain, %", ".3f"),
    "identify_seconds": ("CPU s", ".1f"),
    "fit": ("one fit", ".3f"),
    "fit_gain": ("its gain, %", ".3f"),
    "fit_seconds": ("CPU s", ".1f"),
}


@frozen
class Fresh:
    """Error of a fresh scan, % rms of its range, and of the gain, %; NaN where it is refused."""

    error: float
    gain: float
    seconds: float


def measure(seeds: Sequence[int] = SEEDS) -> Table:
    """Draw, take the records, and predict a fresh scan by both."""
    rows = [case(seed) for seed in seeds]
    medians = [
        f"{name}: median {np.nanmedian(errors):.3f} %, 95th percentile"
        f" {np.nanpercentile(errors, 95.0):.3f} %, none of {int(np.isnan(errors).sum())}"
        for name in ("identify", "fit")
        for errors in [np.array([row[name] for row in rows], float)]
    ]
    title = "\n".join(["Fresh scans of scanners drawn at random, of the true range", *medians])
    return Table("joint_fit", title, COLUMNS, rows)


def case(seed: int) -> Row:
    """One scanner."""
    rng = np.random.default_rng(seed)
    protocol = list(PROTOCOLS)[seed % len(PROTOCOLS)]
    family = FAMILIES[seed // len(PROTOCOLS) % len(FAMILIES)]
    scanner = draw(rng, family)
    records = [record.axis("x") for record in taken(protocol, scanner, rng)]
    drive, rate = fresh_scan(scanner, records)
    true = scanner.axes[0].displacement(DRAWN_FOR / scanner.upper * drive, 1.0 / rate)
    counts = slice(len(drive) // 4, None)
    line = np.polyval(np.polyfit(drive[counts], true[counts], 1), drive[counts])
    left = 100.0 * float(np.std(true[counts] - line) / np.ptp(true[counts]))
    old = _fresh(lambda: afm.identify(records), drive, rate, true)
    new = _fresh(lambda: _fitted(records), drive, rate, true)
    row: Row = {"seed": seed, "protocol": protocol, "family": family, "line": left}
    for name, one in (("identify", old), ("fit", new)):
        row = {**row, name: one.error, f"{name}_gain": one.gain, f"{name}_seconds": one.seconds}
    return row


def fresh_scan(scanner: DrawnScanner, records: Sequence[afm.Record]) -> tuple[Array, float]:
    """Drive (V) and samples a second of triangles over 0.6 of the range that records drive."""
    drives = np.concatenate([record.drive[:, 0] for record in records])
    middle, half = 0.5 * (drives.max() + drives.min()), 0.3 * float(np.ptp(drives))
    rate = 10.0 * scanner.resonance
    phase = (np.arange(8000) / rate * scanner.resonance / 600.0) % 1.0
    cycle = np.interp(phase, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    about = middle - scanner.middle + half * cycle
    return raised(np.concatenate([np.linspace(0.0, about[0], 400), about]), scanner.middle), rate


def _fitted(records: Sequence[afm.Record]) -> afm.Model:
    return afm.Model(ScannerModel(x=model_of(fit_axis(records, "x"))), "one fit of all records")


def _fresh(identified: Callable[[], afm.Model], drive: Array, rate: float, true: Array) -> Fresh:
    begun = time.process_time()
    try:
        model = identified()
        predicted = model.predict(drive[:, np.newaxis], 1.0 / rate)[:, 0]
    except (InputError, ScanError):
        return Fresh(np.nan, np.nan, time.process_time() - begun)
    seconds, counts = time.process_time() - begun, slice(len(drive) // 4, None)
    missed = float(np.std(predicted[counts] - true[counts]) / np.ptp(true[counts]))
    gain = float(np.polyfit(true[counts], predicted[counts], 1)[0]) - 1.0
    return Fresh(100.0 * missed, 100.0 * gain, seconds)
