"""The least tone that a diagnosis names, over the least that a matched filter detects.

A tone of drawn frequency is added to a scan of the simulated scanner, which its model knows with
the error of a calibration. A matched filter with the sensor's noise s known, at a rate of false
alarms of 1 % over all frequencies, detects the amplitude 2 s sqrt(ln(n / 0.02) / n) in n samples.
"""

from functools import cache

import numpy as np
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_bench.scans import ALL, default_plant, scan
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.table import Row, Table

SEED = 41
SPECS = (
    ScanSpec(line_rate=30.0, lines=32, samples_per_line=1000),
    ScanSpec(line_rate=10.0, lines=48, samples_per_line=1000),
    ScanSpec(line_rate=7.0, lines=40, samples_per_line=1430),
)
DRAWN = 4
LOWEST = 1.0
"""Lowest frequency drawn, over the line rate."""
TIMES = (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 5.0, 10.0, 30.0)
FALSE_ALARM = 0.01
NAMED = 0.95

COLUMNS = {
    "rate": ("lines/s", "g"),
    "lines": ("lines", "d"),
    "frequency": ("tone in Hz", ".2f"),
    "from_harmonic": ("from a harmonic, periods", ".1f"),
    "detected": ("detected by a matched filter, nm", ".3f"),
    "times": ("named at times", "g"),
    "healthy": ("without it", ""),
}


def measure() -> Table:
    """Draw tones in each of the scans."""
    rng = np.random.default_rng(SEED)
    rows = [row(spec, _drawn(rng, spec)) for spec in SPECS for _ in range(DRAWN)]
    times = [float(each["times"]) for each in rows]
    low, high = np.nanpercentile(times, (50.0, 95.0))
    title = (
        f"Least amplitude of a tone that is named with a probability of {NAMED:g}, over what a"
        f" matched filter detects\nmedian {low:.3g}, 95th percentile {high:.3g}"
    )
    return Table("tones", title, COLUMNS, rows)


def _drawn(rng: np.random.Generator, spec: ScanSpec) -> float:
    """Frequency (Hz), uniform in the logarithm, up to four tenths of the sample rate."""
    ends = LOWEST * spec.line_rate, 0.4 / spec.sample_period
    return float(np.exp(rng.uniform(*np.log(ends))))


@cache
def _scanned(spec: ScanSpec) -> Scan:
    return scan(spec, ALL)


def row(spec: ScanSpec, frequency: float) -> Row:
    """Raise the amplitude of a tone until it is named."""
    count = len(_scanned(spec).measured.x)
    detected = (
        2.0 * default_plant().sensor.noise_rms * np.sqrt(np.log(count / 2.0 / FALSE_ALARM) / count)
    )
    named = (t for t in TIMES if _named(diagnosed(spec, frequency, t * detected)))
    turns = frequency / spec.line_rate
    return {
        "rate": spec.line_rate,
        "lines": spec.lines,
        "frequency": frequency,
        "from_harmonic": abs(turns - round(turns)) * spec.lines,
        "detected": 1e9 * detected,
        "times": next(named, np.nan),
        "healthy": diagnosed(spec, frequency, 0.0).verdict,
    }


def diagnosed(spec: ScanSpec, frequency: float, size: float) -> afm.Diagnosis:
    """Diagnose the x axis of a scan with a tone of an amplitude (m)."""
    done = _scanned(spec)
    time = spec.sample_period * np.arange(len(done.measured.x))
    tone = size * np.sin(2.0 * np.pi * frequency * time)
    moved = evolve(done.measured, x=done.measured.x + tone)
    record = afm.Record.of_traces("scan", done.drive, moved, spec).axis("x")
    return afm.diagnose(afm.load_model(), [evolve(record, scan=spec)])


def _named(found: afm.Diagnosis) -> bool:
    return any(
        effect.name == "periodic_disturbance" and effect.probability >= NAMED
        for effect in found.effects
    )
