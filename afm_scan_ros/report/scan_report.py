"""The report on one scan, and what adaptation found in one: tables, and the page."""

from collections.abc import Iterator, Mapping

from afm_scan_ros.core.learning.adaptation import CREEP_NAME, AxisState, Outcome
from afm_scan_ros.core.learning.adapted_reference import AxisShift
from afm_scan_ros.core.metrics import AxisError, Figure, Tracking
from afm_scan_ros.report import html
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.quantity import nanometres, percent
from afm_scan_ros.report.scan_figures import ScanExcerpt, tracking_figure
from afm_scan_ros.report.table import Rows

ADAPTED = ("axis", "parameter", "value", "unchanged", "outcome", "detection limit")
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
    return Rows(ADAPTED, rows)


def _rows(axis: str, state: AxisState) -> Iterator[tuple[str, ...]]:
    for name, finding in state.findings.items():
        value, unchanged = (getattr(shift, name) for shift in (state.shift, AxisShift()))
        dead_zone = PER_UNKNOWN.get(name, 1.0) * finding.dead_zone
        limit = "" if finding.outcome is Outcome.NOT_EXCITED else f"{dead_zone:.2g}"
        yield axis, NAMES[name], f"{value:.4f}", f"{unchanged:g}", OUTCOMES[finding.outcome], limit


DEFINITION = (
    "The error is achieved minus desired displacement at the same sample. No delay, gain or offset"
    " is fitted. Its rms is about zero. Percentages are of the axis' desired peak-to-peak. The"
    " first line, the approach and the preparation are not part of 'all'."
)
CAPTION = (
    "Three lines after the first: displacement and error over time, and the x error by position."
)


def scan_report(analysis: Analysis, view: ScanExcerpt) -> str:
    """Return the report as a self-contained HTML page."""
    notes = [html.warning(text) for text in (*analysis.shortcomings, *analysis.warnings)]
    return html.page(
        f"Scan {analysis.scan.scan_id}",
        *notes,
        html.table((), scan_rows(analysis)),
        html.heading("Desired and achieved"),
        html.picture(tracking_figure(view), CAPTION),
        *html.texts(error_tables(analysis)),
        html.paragraph(DEFINITION),
    )


HEADINGS = ("error", "rms, nm", "rms, %", "peak, nm", "peak, %")

Row = tuple[str, ...]


def error_tables(analysis: Analysis) -> Iterator[Rows]:
    """Yield the errors of the true displacement, where it is known, and of the measured one."""
    for tracking in (analysis.true, analysis.measured):
        if tracking is not None:
            title = f"Error of the {tracking.displacement} displacement"
            yield Rows(HEADINGS, error_rows(tracking), title)


def error_rows(tracking: Tracking) -> list[Row]:
    """Return a row for each error; percentages are of the desired peak-to-peak of that axis."""
    named = (*_x(tracking), *_y(tracking.y), *_apart(tracking))
    rows = [_row(name, figure) for name, figure in named if figure is not None]
    for axis, error in (("x", tracking.x), ("y", tracking.y)):
        if error.repeatability is not None:
            share = percent(error.repeatability / error.peak_to_peak)
            name = f"{axis}, line-to-line repeatability"
            rows.append((name, nanometres(error.repeatability), share, "", ""))
    return rows


def scan_rows(analysis: Analysis) -> list[Row]:
    """Return what was scanned, and with what, as names and values."""
    scan, spec, drive = analysis.scan, analysis.scan.spec, analysis.drive
    rows: list[Row] = [("scan", scan.scan_id), ("pattern", scan.pattern)]
    if spec is not None:
        rows += [
            ("range", f"{1e6 * spec.range_x:g} µm by {1e6 * spec.range_y:g} µm"),
            ("line rate", f"{spec.line_rate:g} Hz, {spec.samples_per_line} samples per line"),
            ("lines", f"{analysis.measured.lines} of {spec.lines}"),
        ]
    rows += [
        ("samples", f"{analysis.measured.samples:,} of {scan.total_samples:,}"),
        ("inverses", ", ".join(scan.inverses) or "none"),
        ("model", scan.model_hash[:12] or "none"),
    ]
    if drive is not None:
        rows += [
            ("drive x", f"{drive.lowest_x:.2f} to {drive.highest_x:.2f} V"),
            ("drive y", f"{drive.lowest_y:.2f} to {drive.highest_y:.2f} V"),
        ]
    return rows


def _x(tracking: Tracking) -> Iterator[tuple[str, Figure | None]]:
    yield "x, trace minus retrace", tracking.mismatch
    yield "x, constant speed", tracking.x.constant_speed
    yield "x, turn-arounds", tracking.x.turnarounds
    yield "x, all", tracking.x.all


def _y(error: AxisError) -> Iterator[tuple[str, Figure | None]]:
    yield "y, on trace", error.trace
    yield "y, over the step", error.step
    yield "y, all", error.all


def _apart(tracking: Tracking) -> Iterator[tuple[str, Figure | None]]:
    for axis, error in (("x", tracking.x), ("y", tracking.y)):
        yield f"{axis}, first line", error.first_line
        yield f"{axis}, approach", error.approach
        yield f"{axis}, preparation", error.preparation


def _row(name: str, figure: Figure) -> Row:
    return (
        name,
        nanometres(figure.rms),
        percent(figure.rms_share),
        nanometres(figure.largest),
        percent(figure.largest_share),
    )
