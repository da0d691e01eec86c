"""What learning from repeated scans reaches: the targets of tracking, on the default scanner.

A scan is learned from its measured displacement alone. Its figures are those of the true one.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from attrs import frozen

from afm_scan_bench.curve import TableCurve, curve_figure
from afm_scan_bench.detune import detuned
from afm_scan_bench.learning.repeated import SCANS, repeated
from afm_scan_bench.scans import default_plant, rms_percent, spec_at, tracking
from afm_scan_ros.core.comparison import RELEVANT_CHANGE, rms_of
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.learning.loop import LearningScan, best_of
from afm_scan_ros.report.table import Row, Table

COLUMNS = {
    "line_rate_hz": ("line rate, Hz", ".0f"),
    "shift_percent": ("resonance and damping off by, %", "+d"),
    "first_percent": ("feedforward, % rms", ".4f"),
    "learned_percent": (f"after {SCANS} scans", ".4f"),
    "target_percent": ("target", ".3f"),
    "met": ("met", ""),
    "growth": ("largest growth, x and y", ".3f"),
    "growth_nm": ("largest growth, nm", ".2f"),
    "monotone": ("monotone", ""),
}
BY_SCAN = {
    "line_rate_hz": ("line rate, Hz", ".0f"),
    "scan": ("scan", ".0f"),
    "case": ("plant", ""),
    "error_percent": ("true error of x at constant speed, % rms", ".4f"),
}


@frozen
class LearningCase:
    """A plant whose resonance and damping are off by a share, and the target of its error, %."""

    line_rate: float
    shift_percent: int
    target: float

    def learned(self, seed: int) -> list[LearningScan]:
        """Learn the scan at this line rate."""
        factor = 1.0 + self.shift_percent / 100.0
        plant = detuned(default_plant(), factor, factor)
        return repeated(spec_at(self.line_rate), plant, seed=seed)


CASES = (
    LearningCase(100.0, -5, 0.05),
    LearningCase(100.0, 5, 0.05),
    LearningCase(250.0, -5, 0.2),
    LearningCase(250.0, 5, 0.2),
    LearningCase(250.0, 0, 0.15),
    LearningCase(1.0, 0, 0.015),
    LearningCase(5.0, 0, 0.015),
    LearningCase(30.0, 0, 0.015),
)


def measure(cases: Sequence[LearningCase] = CASES, seed: int = 1) -> Table:
    """Learn each case's scan."""
    found = {case: case.learned(seed) for case in cases}
    rows = [_row(case, scans) for case, scans in found.items()]
    points = [point for case, scans in found.items() for point in _by_scan(case, scans)]
    title = "True error of x at constant speed, learned from the measured displacement"
    curve = TableCurve("scan", "error_percent", by="case", logarithmic=True, panel="line_rate_hz")
    return Table(
        "learning",
        title,
        COLUMNS,
        rows,
        lambda: curve_figure(curve, title, BY_SCAN, points),
    )


def error_percent(done: LearningScan) -> float:
    """True error of x at constant speed, % of the range, rms."""
    return rms_percent(tracking(done.scan).x.constant_speed)


def growths(scans: Sequence[LearningScan]) -> list[tuple[float, float]]:
    """Each scan's true error over that before it, and their difference in m, of each axis."""
    errors = [[rms_of(tracking(done.scan), axis) for done in scans] for axis in AXES]
    pairs = [pair for each in errors for pair in pairwise(each)]
    return [(after / before, after - before) for before, after in pairs]


def _row(case: LearningCase, scans: Sequence[LearningScan]) -> Row:
    learned, (ratio, difference) = (
        error_percent(best_of(list(scans))),
        map(max, zip(*growths(scans), strict=True)),
    )
    return {
        "line_rate_hz": case.line_rate,
        "shift_percent": case.shift_percent,
        "first_percent": error_percent(scans[0]),
        "learned_percent": learned,
        "target_percent": case.target,
        "met": "yes" if learned <= case.target else "no",
        "growth": ratio,
        "growth_nm": 1e9 * difference,
        "monotone": "yes" if ratio <= 1.0 + RELEVANT_CHANGE else "no",
    }


def _by_scan(case: LearningCase, scans: Sequence[LearningScan]) -> Iterator[Row]:
    for number, done in enumerate(scans, start=1):
        yield {
            "line_rate_hz": case.line_rate,
            "scan": number,
            "case": f"{case.shift_percent:+d} %" if case.shift_percent else "nominal",
            "error_percent": error_percent(done),
        }
