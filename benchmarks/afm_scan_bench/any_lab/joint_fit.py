"""The fit of all records: fresh scans of scanners drawn at random.

Each scanner is of the family and its records of the protocol whose turn it is, as in ``any_lab``.
The error of the x axis is against the true displacement of a triangle over 0.6 of the driven range,
at a rate that no record has. Its mean counts neither in the error nor in the standard deviation
that is stated, but is given as the offset.
"""

import time
from collections.abc import Sequence

import numpy as np

import afm_scan_ros as afm
from afm_scan_bench.any_lab.protocols import PROTOCOLS, raised, taken
from afm_scan_bench.any_lab.scanner import DRAWN_FOR, FAMILIES, DrawnScanner, draw
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.identify import FittedAxis, identify_axis
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.prediction import apart, discrepancy
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

SEEDS = range(40)
INTERVAL = 1.645
"""Standard deviations to either end of a 90 % interval of a normal variable."""
COLUMNS = {
    "seed": ("seed", "d"),
    "protocol": ("records", ""),
    "family": ("hysteresis", ""),
    "line": ("one gain, % of range", ".2f"),
    "error": ("error, % of range", ".4f"),
    "gain": ("gain, %", ".3f"),
    "offset": ("offset, %", ".4f"),
    "stated": ("stated, %", ".4f"),
    "covered": ("in 90 % intervals", ".2f"),
    "operator": ("operator", ""),
    "seconds": ("CPU s", ".0f"),
}


def measure(seeds: Sequence[int] = SEEDS) -> Table:
    """Draw, take the records, and predict a fresh scan."""
    rows = [case(seed) for seed in seeds]
    errors = np.array([row["error"] for row in rows], float)
    title = (
        "Fresh scans of scanners drawn at random, of the true range\n"
        f"median {np.nanmedian(errors):.3f} %, 95th percentile"
        f" {np.nanpercentile(errors, 95.0):.3f} %,"
        f" none of {int(np.isnan(errors).sum())}\n{_known(rows)}"
    )
    return Table("joint_fit", title, COLUMNS, rows)


def case(seed: int) -> Row:
    """One scanner; its figures are NaN where its records are refused."""
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
    row: Row = {"seed": seed, "protocol": protocol, "family": family, "line": left}
    begun = time.process_time()
    try:
        found = identify_axis(records, "x")
    except (InputError, ScanError) as error:
        return {
            **row,
            "error": np.nan,
            "gain": np.nan,
            "offset": np.nan,
            "stated": np.nan,
            "covered": np.nan,
            "operator": str(error),
            "seconds": time.process_time() - begun,
        }
    seconds = time.process_time() - begun
    return {**row, **_errors(found, drive, rate, true, counts), "seconds": seconds}


def _known(rows: Sequence[Row]) -> str:
    """How what is stated compares with the errors."""
    error, stated, covered = (
        np.array([row[name] for row in rows], float) for name in ("error", "stated", "covered")
    )
    return (
        f"stated over true {np.nanmedian(stated / error):.2f} in the median,"
        f" 90 % intervals hold {np.nanmean(covered):.0%} of the samples"
    )


def _errors(found: FittedAxis, drive: Array, rate: float, true: Array, counts: slice) -> Row:
    """Error and gain of the predicted scan where it ``counts``, and what is stated, all in %."""
    model = afm.Model(ScannerModel(x=found.model), "one fit of all records")
    moved = model.predict(drive, 1.0 / rate)
    missed, scale = (moved - true)[counts], 100.0 / float(np.ptp(true[counts]))
    offset, stated = float(np.mean(missed)), _stated(found.model, drive, 1.0 / rate, moved)[counts]
    return {
        "error": scale * float(np.std(missed)),
        "gain": 100.0 * (float(np.polyfit(true[counts], moved[counts], 1)[0]) - 1.0),
        "offset": scale * offset,
        "stated": scale * float(np.sqrt(np.mean(stated**2))),
        "covered": float(np.mean(np.abs(missed - offset) < INTERVAL * stated)),
        "operator": found.operator,
    }


def _stated(axis: AxisModel, drive: Array, period: float, moved: Array) -> Array:
    """Standard deviation (m) of a prediction but for its mean where it counts, (n,)."""
    if axis.spread is None:
        return np.full_like(moved, np.nan)
    known = apart(axis, axis.spread, drive, period)
    known -= known[:, len(drive) // 4 :].mean(axis=1, keepdims=True)
    left = discrepancy(axis.spread, moved, period)
    return np.asarray(np.sqrt(np.sum(known**2, axis=0) + left**2))


def fresh_scan(scanner: DrawnScanner, records: Sequence[afm.Record]) -> tuple[Array, float]:
    """Drive (V) and samples a second of triangles over 0.6 of the range that records drive."""
    drives = np.concatenate([record.drive[:, 0] for record in records])
    middle, half = 0.5 * (drives.max() + drives.min()), 0.3 * float(np.ptp(drives))
    rate = 10.0 * scanner.resonance
    phase = (np.arange(8000) / rate * scanner.resonance / 600.0) % 1.0
    cycle = np.interp(phase, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    about = middle - scanner.middle + half * cycle
    return raised(np.concatenate([np.linspace(0.0, about[0], 400), about]), scanner.middle), rate
