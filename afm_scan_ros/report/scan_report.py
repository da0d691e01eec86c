"""The reports on one scan, and on the demonstration: tables, pages."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeAlias

from attrs import frozen
from matplotlib.figure import Figure

from afm_scan_ros.core.metrics import AxisError, Tracking
from afm_scan_ros.core.metrics import Figure as Error
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.report import html
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.quantity import nanometres, percent
from afm_scan_ros.report.scan_figures import Images, ScanExcerpt, image_figure, tracking_figure
from afm_scan_ros.report.table import Row, Rows, Table

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

TextRow = tuple[str, ...]


def error_tables(analysis: Analysis) -> Iterator[Rows]:
    """Yield the errors of the true displacement, where it is known, and of the measured one."""
    for tracking in (analysis.true, analysis.measured):
        if tracking is not None:
            title = f"Error of the {tracking.displacement} displacement"
            yield Rows(HEADINGS, error_rows(tracking), title)


def error_rows(tracking: Tracking) -> list[TextRow]:
    """Return a row for each error; percentages are of the desired peak-to-peak of that axis."""
    named = (*_x(tracking), *_y(tracking.y), *_apart(tracking))
    rows = [_row(name, figure) for name, figure in named if figure is not None]
    for axis, error in (("x", tracking.x), ("y", tracking.y)):
        if error.repeatability is not None:
            share = percent(error.repeatability / error.peak_to_peak)
            name = f"{axis}, line-to-line repeatability"
            rows.append((name, nanometres(error.repeatability), share, "", ""))
    return rows


def scan_rows(analysis: Analysis) -> list[TextRow]:
    """Return what was scanned, and with what, as names and values."""
    scan, spec, drive = analysis.scan, analysis.scan.spec, analysis.drive
    rows: list[TextRow] = [("scan", scan.scan_id), ("pattern", scan.pattern)]
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


def _x(tracking: Tracking) -> Iterator[tuple[str, Error | None]]:
    yield "x, trace minus retrace", tracking.mismatch
    yield "x, constant speed", tracking.x.constant_speed
    yield "x, turn-arounds", tracking.x.turnarounds
    yield "x, all", tracking.x.all


def _y(error: AxisError) -> Iterator[tuple[str, Error | None]]:
    yield "y, on trace", error.trace
    yield "y, over the step", error.step
    yield "y, all", error.all


def _apart(tracking: Tracking) -> Iterator[tuple[str, Error | None]]:
    for axis, error in (("x", tracking.x), ("y", tracking.y)):
        yield f"{axis}, first line", error.first_line
        yield f"{axis}, approach", error.approach
        yield f"{axis}, preparation", error.preparation


def _row(name: str, figure: Error) -> TextRow:
    return (
        name,
        nanometres(figure.rms),
        percent(figure.rms_share),
        nanometres(figure.largest),
        percent(figure.largest_share),
    )


ABOUT = (
    "A simulated scanner moves over 40 µm by 40 µm. The model that is inverted was identified from"
    " simulated records, so it is not exact. Each scan ran as separate processes and is recorded"
    " in a bag. The error is achieved minus desired displacement, in percent of the range. Nothing"
    " is fitted. Only 'measured' errors contain sensor noise. Without compensation each axis has"
    " one constant gain. Errors in x are those of the constant-speed part. Errors in y are those on"
    " trace, except those over its step."
)
IMAGE = (
    "A simulated grating of 16 µm pitch and 100 nm height, scanned at {rate:g} Hz with {lines}"
    " lines. Each height is drawn at the desired position. The height error is {without} nm rms"
    " without compensation and {with_} nm rms with compensation."
)


@frozen
class DemoScan:
    """One scan of the demonstration."""

    line_rate: float
    name: str
    inverses: tuple[str, ...]
    lines: int

    @property
    def stem(self) -> str:
        """What its files are called."""
        return f"{self.line_rate:g}hz_{self.name.replace(' ', '_')}"


Scanned: TypeAlias = dict[DemoScan, Analysis]


def tracking(done: Scanned) -> Table:
    """Errors without and with all inverses, at each line rate."""
    columns = {
        "line_rate_hz": ("line rate, Hz", "g"),
        "inverses": ("inverses", ""),
        "x_rms": ("x, rms", ".3f"),
        "x_measured_rms": ("x measured, rms", ".3f"),
        "x_largest": ("x, peak", ".3f"),
        "mismatch_rms": ("x trace minus retrace, rms", ".3f"),
        "y_rms": ("y, rms", ".3f"),
        "y_step_largest": ("y over its step, peak", ".3f"),
    }
    rows = [_demo_row(case, done[case]) for case in done if case.name in ("none", "all")]
    return Table("tracking", "Tracking error, in % of the range", columns, rows)


def contributions(done: Scanned, line_rate: float) -> Table:
    """What each inverse does alone, and the error when it alone is missing."""
    errors = {
        case.name: _percent(_true(analysis).x.constant_speed)
        for case, analysis in done.items()
        if case.line_rate == line_rate
    }
    columns = {
        "inverse": ("inverse", ""),
        "none": ("no inverse", ".3f"),
        "alone": ("this one alone", ".3f"),
        "all_but": ("all but this one", ".3f"),
        "all": ("all inverses", ".3f"),
    }
    rows: list[Row] = [
        {
            "inverse": name,
            "none": errors["none"],
            "alone": errors[f"{name} alone"],
            "all_but": errors[f"all but {name}"],
            "all": errors["all"],
        }
        for name in INVERSES
    ]
    title = f"Contribution of each inverse at {line_rate:g} Hz: x error, rms, in % of the range"
    return Table("contributions", title, columns, rows)


def report(
    tables: Iterable[Table],
    figures: Mapping[float, Figure],
    imaged: tuple[DemoScan, Images],
    commands: Iterable[tuple[str, str]],
) -> str:
    """Return everything as one HTML page that needs nothing else.

    ``commands`` are what to do next: a purpose and the command line that serves it.
    """
    pictures = [
        html.picture(figure, f"{rate:g} Hz: three lines, without and with compensation")
        for rate, figure in figures.items()
    ]
    return html.page(
        "A piezoscanner without and with compensation",
        html.paragraph(ABOUT),
        *html.texts(table.text() for table in tables),
        html.heading("Image of a grating"),
        _grating(*imaged),
        html.heading("Displacement and error of x and y"),
        *pictures,
        html.heading("What to do next"),
        *(html.command(purpose, line) for purpose, line in commands),
    )


def _grating(of: DemoScan, images: Images) -> str:
    without, compensated = map(nanometres, images.errors)
    caption = IMAGE.format(rate=of.line_rate, lines=of.lines, without=without, with_=compensated)
    return html.picture(image_figure(images), caption)


def _demo_row(case: DemoScan, analysis: Analysis) -> dict[str, float | str]:
    true = _true(analysis)
    return {
        "line_rate_hz": case.line_rate,
        "inverses": case.name,
        "x_rms": _percent(true.x.constant_speed),
        "x_largest": _percent(true.x.constant_speed, largest=True),
        "mismatch_rms": _percent(true.mismatch),
        "y_rms": _percent(true.y.trace),
        "y_step_largest": _percent(true.y.step, largest=True),
        "x_measured_rms": _percent(analysis.measured.x.constant_speed),
    }


def _true(analysis: Analysis) -> Tracking:
    if analysis.true is None:
        raise ValueError("the demonstration's scanner is simulated and records its true motion")
    return analysis.true


def _percent(error: Error | None, *, largest: bool = False) -> float:
    if error is None:
        raise ValueError("the demonstration's scans have every kind of sample")
    return 100.0 * (error.largest_share if largest else error.rms_share)
