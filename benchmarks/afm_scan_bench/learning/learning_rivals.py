"""Learning beside published laws of iterative learning, on the same plants and scans."""

from collections.abc import Iterator

from attrs import evolve

from afm_scan_bench.curve import TableCurve, curve_figure
from afm_scan_bench.detune import detuned
from afm_scan_bench.learning.repeated import SCANS, repeated
from afm_scan_bench.learning.rivals import LAWS, best_learned
from afm_scan_bench.mechanisms.product_sizes import sized
from afm_scan_bench.scans import default_plant, rms_percent, spec_at, tracking
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.scanner import PlantSpec

RATES = (5.0, 100.0, 250.0)
SHIFTS = (-5, 0, 5)
OURS = "afm-scan learn"
CYCLES = 5
"""Oscillations of the preparation."""

NUMBERS = range(1, SCANS + 1)
COLUMNS = {
    "case": ("plant and line rate", ""),
    "law": ("law", ""),
    **{f"scan_{k}": (f"scan {k}", ".4f") for k in NUMBERS},
    "best": ("best", ".4f"),
}
POINTS = {
    "case": ("plant and line rate", ""),
    "law": ("law", ""),
    "scan": ("scan", ".0f"),
    "error": ("true error of x at constant speed, % rms", ".4f"),
}


def measure(seed: int = 1) -> Table:
    """Learn each case by each law."""
    rows: list[Row] = []
    with working("rivals") as announce:
        for case, (spec, plant) in cases().items():
            announce(case)
            rows += _rows(case, spec, plant, seed)
    title = "True error of x at constant speed, % rms, by scan"
    points = [
        {"case": row["case"], "law": row["law"], "scan": k, "error": row[f"scan_{k}"]}
        for row in rows
        for k in NUMBERS
    ]
    curve = TableCurve("scan", "error", by="law", logarithmic=True, panel="case")
    return Table(
        "learning_rivals", title, COLUMNS, rows, lambda: curve_figure(curve, title, POINTS, points)
    )


def cases() -> dict[str, tuple[ScanSpec, PlantSpec]]:
    """Scan and plant by the name of each case."""
    specs = {rate: evolve(spec_at(rate), preparation_cycles=CYCLES) for rate in RATES}
    loose = evolve(default_plant(), mechanisms=sized("backlash", "large", "x"))
    shifted = {
        f"{rate:g} Hz, {shift:+d} %" if shift else f"{rate:g} Hz": (
            spec,
            detuned(default_plant(), 1.0 + shift / 100.0, 1.0 + shift / 100.0),
        )
        for rate, spec in specs.items()
        for shift in SHIFTS
    }
    return {**shifted, "5 Hz, backlash": (specs[5.0], loose)}


def _rows(case: str, spec: ScanSpec, plant: PlantSpec, seed: int) -> Iterator[Row]:
    ours = [done.scan for done in repeated(spec, plant, seed=seed)]
    courses = {
        OURS: ours,
        **{name: best_learned(spec, plant, laws, SCANS, seed) for name, laws in LAWS.items()},
    }
    for law, course in courses.items():
        errors = [rms_percent(tracking(done).x.constant_speed) for done in course]
        errors += [float("nan")] * (SCANS - len(errors))
        numbered = {f"scan_{k}": error for k, error in zip(NUMBERS, errors, strict=True)}
        yield {"case": case, "law": law, **numbered, "best": min(errors[: len(course)])}
