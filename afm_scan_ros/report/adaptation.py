"""What adaptation found during a scan, in rows and sentences."""

from collections.abc import Iterator, Mapping

from afm_scan_ros.core.learning.adaptation import CREEP_NAME, AxisState, Outcome
from afm_scan_ros.core.learning.axis_shift import AxisShift
from afm_scan_ros.report.table import Rows

HEADINGS = ("axis", "parameter", "value", "unchanged", "outcome", "detection limit")
NAMES = {
    "gain": "factor on the gain",
    "frequency": "factor on the first resonance's frequency",
    "loss": "factor on its damping ratio, over that on the frequency",
    CREEP_NAME: "gain of slow creep beyond the model's",
}
OUTCOMES = {
    Outcome.UNCHANGED: "within the detection limit",
    Outcome.CHANGED: "changed",
    Outcome.NOT_EXCITED: "not excited by this scan",
    Outcome.BEYOND_BOUNDS: "beyond its bounds: identify the scanner anew",
    Outcome.OTHER_CAUSE: "not distinguished from another change: diagnose this scan",
}


PER_UNKNOWN = {"frequency": 0.5}
"""Change of a value per change of its unknown, near 1; 1 where it is left out: a = 1/f² - 1."""


def adaptation_rows(states: Mapping[str, AxisState]) -> Rows:
    """Return one row for each axis and parameter."""
    rows = [row for name, state in states.items() for row in _rows(name, state)]
    return Rows(HEADINGS, rows)


def _rows(axis: str, state: AxisState) -> Iterator[tuple[str, ...]]:
    for name, finding in state.findings.items():
        value, unchanged = (getattr(shift, name) for shift in (state.shift, AxisShift()))
        dead_zone = PER_UNKNOWN.get(name, 1.0) * finding.dead_zone
        limit = "" if finding.outcome is Outcome.NOT_EXCITED else f"{dead_zone:.2g}"
        yield axis, NAMES[name], f"{value:.4f}", f"{unchanged:g}", OUTCOMES[finding.outcome], limit
