"""Whether a correction that one scan has learned helps another one.

``afm-scan scan`` refuses it for another scan. Here it is used as it is, and scaled by the ratio of
the ranges. A correction follows the lines, sample by sample, at another line rate too.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_bench.detune import detuned
from afm_scan_bench.learning.repeated import RepeatingScanner, repeated
from afm_scan_bench.scans import default_model, default_plant, rms_percent, spec_at, tracking
from afm_scan_ros.core.correction import Correction, window
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.learning.loop import best_of
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.scanner import PlantSpec

RATES = (5.0, 100.0)
SHIFTS = (0, 5)
SIZES = (0.9, 0.5)
SPEEDS = (0.9, 0.99, 1.01, 1.1)

COLUMNS = {
    "line_rate_hz": ("learned at, Hz", ".0f"),
    "shift_percent": ("resonance off by, %", "+d"),
    "other": ("used for", ""),
    "feedforward_percent": ("feedforward, % rms", ".4f"),
    "as_it_is": ("correction as it is, over that", ".2f"),
    "scaled": ("scaled by the range", ".2f"),
}


def measure(seed: int = 1) -> Table:
    """Use the corrections of some scans for others."""
    rows = [row for rate in RATES for shift in SHIFTS for row in _rows(rate, shift, seed)]
    title = "True error of x at constant speed with the correction of another scan"
    return Table("learning_transfer", title, COLUMNS, rows)


def others(spec: ScanSpec) -> dict[str, ScanSpec]:
    """Scans like a scan, by what differs."""
    sizes = {
        f"{size:.0%} of the size": evolve(
            spec, range_x=size * spec.range_x, range_y=size * spec.range_y
        )
        for size in SIZES
    }
    rates = {
        f"{speed:.0%} of the line rate": evolve(spec, line_rate=speed * spec.line_rate)
        for speed in SPEEDS
    }
    return {"the same": spec, **sizes, **rates}


def transferred(correction: Correction, spec: ScanSpec, factor: float) -> Correction:
    """Return a correction times a factor, its samples where the same samples of the lines are."""
    before, after = phases(correction.spec), phases(spec)
    there = np.arange(before.total) - before.lines.start
    here = np.arange(after.total) - after.lines.start
    share = factor * window(spec)

    def moved(signal: Array) -> Array:
        return np.asarray(share * np.interp(here, there, signal))

    return Correction(spec, moved(correction.x), moved(correction.y))


def _rows(rate: float, shift: int, seed: int) -> Iterator[Row]:
    factor = 1.0 + shift / 100.0
    spec, plant = spec_at(rate), detuned(default_plant(), factor, factor)
    correction = best_of(repeated(spec, plant, seed=seed)).correction
    for name, other in others(spec).items():
        before = _error(plant, Correction.none(other), seed)
        size = other.range_x / spec.range_x
        yield {
            "line_rate_hz": rate,
            "shift_percent": shift,
            "other": name,
            "feedforward_percent": before,
            "as_it_is": _error(plant, transferred(correction, other, 1.0), seed) / before,
            "scaled": _error(plant, transferred(correction, other, size), seed) / before,
        }


def _error(plant: PlantSpec, correction: Correction, seed: int) -> float:
    """Error of a scan, %; NaN where the drive would leave its limits."""
    try:
        done = RepeatingScanner(plant, seed).scan(
            "transferred", correction.spec, default_model(), correction
        )
    except ScanError:
        return float("nan")
    return rms_percent(tracking(done).x.constant_speed)
