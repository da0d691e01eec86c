"""Diagnoses of scanners of five hysteresis families, with effects in equations of their own."""

import time
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from attrs import evolve, frozen
from scipy.optimize import brentq

from afm_scan_bench.diagnosis.unmodelled.summary import counted
from afm_scan_bench.families.effects import ALTERATIONS, Alteration, altered, measured
from afm_scan_bench.families.scanners import FAMILIES, FamilyScanner
from afm_scan_bench.scans import ALL, default_plant, spec_at
from afm_scan_ros.core.closed_loop.validation_scans import preview_of
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND, AxisDiagnosis, diagnose_axis
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.result import NONE
from afm_scan_ros.core.identification.identify import identify_axis
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.report.table import Row, Table

SEED, HEALTHY = 11, 4
SIZES = {"small": 60e-9, "medium": 150e-9, "large": 500e-9}
"""Rms that an effect adds to the true displacement, m."""
RATES = {"drift": 5.0, "creep": 5.0, "resonance": 100.0, "mode": 100.0}
RATE, LINES, SHARE = 30.0, (6, 16, 40), (0.3, 0.6)
LEAST, GROWTH, PRECISION = 1e-2, 1.5, 1e-3
"""Of the search for an effect's size: its start over the guess, its steps, and its precision."""
BINS = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)

COLUMNS = {
    "family": ("family", ""),
    "effect": ("effect", ""),
    "size": ("size", ""),
    "lines": ("lines", "d"),
    "healthy_nm": ("healthy residual, nm", ".0f"),
    "verdict": ("verdict", ""),
    "stated": ("stated", ""),
    "probability": ("probability of the truth", ".3f"),
    "seconds": ("s", ".0f"),
}


@frozen(eq=False)
class Laboratory:
    """A healthy scanner of a family, and the model that was identified on it."""

    family: str
    scanner: FamilyScanner
    model: ScannerModel

    @classmethod
    def of(cls, family: str) -> "Laboratory":
        """Identify the scanner from its four calibration records."""
        maps = "none" if family in ("play", "duhem") else "cube behind"
        scanner = FamilyScanner.of(family, maps)
        axis = identify_axis(*scanner.records(SEED).values()).model
        return cls(family, scanner, ScannerModel(axis, axis))

    def drive(self, spec: ScanSpec) -> Array:
        """Drive (n,) in V of a scan with all inverses."""
        settings = InverseSettings(preview=preview_of(self.model, spec.sample_period))
        limits = default_plant().amplifier.limits
        compensation = Compensation(self.model, spec.sample_period, ALL, settings, limits)
        return compensation.whole(desired(spec, 0, total_samples(spec))).x

    def diagnosed(self, spec: ScanSpec, drive: Array, moved: Array) -> AxisDiagnosis:
        """Diagnose x from its drive (V) and its displacement (m)."""
        alone, record = evolve(self.model, y=None), _record(spec, drive, moved)
        return diagnose_axis("x", alone, [record], lambda _: None)

    def residual(self, spec: ScanSpec, drive: Array, moved: Array) -> float:
        """Rms (m) that the model leaves of a displacement (m), without its mean."""
        alone = evolve(self.model, y=None)
        seen = evidence_of("x", alone, _record(spec, drive, moved))
        return float(np.std(seen.residual(chain_of(alone.axis("x")))))


def _record(spec: ScanSpec, drive: Array, moved: Array) -> Observation:
    still, period = np.zeros_like(drive), spec.sample_period
    traces = Trace(0, period, drive, still), Trace(0, period, moved, still)
    return Observation("scan", *traces, spec, axes=("x",))


def measure() -> Table:
    """Diagnose every effect at every size on a scanner of every family, and healthy scans."""
    rows = [row for family in FAMILIES for row in rows_of(family)]
    return Table("diagnosis_families", _title(rows), COLUMNS, rows)


def rows_of(family: str) -> Iterator[Row]:
    """Rows of one family, the healthy scans first."""
    laboratory = Laboratory.of(family)
    rng = np.random.default_rng((SEED, sum(map(ord, family))))
    cases = [("healthy", "")] * HEALTHY + [(e, s) for e in ALTERATIONS for s in SIZES]
    for number, (effect, size) in enumerate(cases):
        reach = float(rng.uniform(*SHARE)) * laboratory.scanner.reach()
        known = spec_at(RATES.get(effect, RATE))
        spec = evolve(known, lines=int(rng.choice(LINES)), range_x=reach, range_y=reach)
        yield _row(laboratory, effect, size, spec, number)


def _row(laboratory: Laboratory, effect: str, size: str, spec: ScanSpec, number: int) -> Row:
    drive, period = laboratory.drive(spec), spec.sample_period
    nothing = Alteration("", 0.0)
    healthy = moved = altered(laboratory.scanner, nothing, 0.0, drive, period)
    truth = ALTERATIONS[effect].name if effect in ALTERATIONS else NONE
    if effect in ALTERATIONS:
        moved = _sized(laboratory, ALTERATIONS[effect], SIZES[size], drive, period, healthy)
    began = time.perf_counter()
    found = laboratory.diagnosed(spec, drive, measured(moved, period, number))
    seconds = time.perf_counter() - began
    posterior, selected = found.selection.posterior, found.selection.selected
    named = {n for names in posterior.probability for n in names}
    return {
        "family": laboratory.family,
        "effect": effect,
        "size": size,
        "lines": spec.lines,
        "healthy_nm": 1e9 * laboratory.residual(spec, drive, measured(healthy, period, number)),
        "truth": truth,
        "verdict": found.verdict,
        "stated": " + ".join(sorted(selected.names)) if selected else NONE,
        "probability": posterior.probability[()] if truth == NONE else posterior.of_effect(truth),
        "probabilities": "; ".join(f"{n} {posterior.of_effect(n):.4f}" for n in sorted(named)),
        "seconds": seconds,
    }


def _sized(
    laboratory: Laboratory,
    effect: Alteration,
    goal: float,
    drive: Array,
    period: float,
    healthy: Array,
) -> Array:
    """Displacement with the effect of the least size that adds ``goal`` (m) rms.

    A resonance that moves on may cross a harmonic and add less again.
    """

    def added(size: float) -> float:
        return float(np.std(altered(laboratory.scanner, effect, size, drive, period) - healthy))

    size = LEAST * effect.guess
    while added(GROWTH * size) < goal:
        size *= GROWTH
    found = brentq(lambda one: added(one) - goal, size, GROWTH * size, rtol=PRECISION)
    return altered(laboratory.scanner, effect, float(found), drive, period)


def _title(rows: Sequence[Row]) -> str:
    altered_ones = [row for row in rows if row["truth"] != NONE]
    healthy = [row for row in rows if row["truth"] == NONE]
    found = [row for row in altered_ones if row["verdict"] == FOUND]
    wrong = sum(row["stated"] != row["truth"] for row in found)
    false = sum(row["verdict"] == FOUND for row in healthy)
    return "\n".join(
        (
            "Effects on scanners of five hysteresis families, diagnosed from one scan",
            counted("named", len(found) - wrong, len(altered_ones)),
            counted("a wrong name with confidence", wrong, len(altered_ones)),
            counted("an effect found on a healthy scan", false, len(healthy)),
            *_reliability(rows),
        )
    )


def _reliability(rows: Sequence[Row]) -> Iterator[str]:
    """Say by stated probability of an effect how often the scanner had it."""
    pairs = [
        (float(stated.split()[1]), stated.split()[0] == row["truth"])
        for row in rows
        for stated in str(row["probabilities"]).split("; ")
        if stated
    ]
    for low, high in pairwise(BINS):
        within = [true for p, true in pairs if low < p <= high]
        if within:
            text = f"the effect is there, at a stated probability of {low:g} to {high:g}"
            yield counted(text, sum(within), len(within))
