"""The report on one scan: tables for the terminal, and the page."""

from collections.abc import Iterator

from afm_scan_ros.core.metrics import AxisError, Figure, Tracking
from afm_scan_ros.report import html
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.quantity import nanometres, percent
from afm_scan_ros.report.scan_figures import ScanExcerpt, tracking_figure
from afm_scan_ros.report.table import Rows

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
