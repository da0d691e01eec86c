"""The reports on one scan, and on the demonstration: tables, pages."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeAlias

from attrs import frozen
from matplotlib.figure import Figure

from afm_scan_ros.core.metrics import Figure as Error
from afm_scan_ros.core.metrics import Tracking
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.report import html
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.quantity import nanometres, percent
from afm_scan_ros.report.scan_figures import Images, ScanExcerpt, image_figure, tracking_figure
from afm_scan_ros.report.table import Row, Rows, Table


def scan_report(analysis: Analysis, view: ScanExcerpt) -> str:
    """Return the report as a self-contained HTML page."""
    return html.page(
        "scan.html",
        analysis=analysis,
        scanned=Rows((), scan_rows(analysis)),
        lines=html.png(tracking_figure(view)),
        errors=error_tables(analysis),
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
    x, y = tracking.x, tracking.y
    named = {
        "x, trace minus retrace": tracking.mismatch,
        "x, constant speed": x.constant_speed,
        "x, turn-arounds": x.turnarounds,
        "x, all": x.all,
        "y, on trace": y.trace,
        "y, over the step": y.step,
        "y, all": y.all,
        "x, first line": x.first_line,
        "x, approach": x.approach,
        "x, preparation": x.preparation,
        "y, first line": y.first_line,
        "y, approach": y.approach,
        "y, preparation": y.preparation,
    }
    rows = [_row(name, figure) for name, figure in named.items() if figure is not None]
    for axis, error in (("x", x), ("y", y)):
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


def _row(name: str, figure: Error) -> TextRow:
    return (
        name,
        nanometres(figure.rms),
        percent(figure.rms_share),
        nanometres(figure.largest),
        percent(figure.largest_share),
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
    ran: str,
) -> str:
    """Return everything as one HTML page that needs nothing else.

    ``commands`` are what to do next: a purpose and the command line that serves it. ``ran`` says
    how the scans ran.
    """
    scan, images = imaged
    return html.page(
        "demo.html",
        tables=[table.text() for table in tables],
        imaged=scan,
        grating=html.png(image_figure(images)),
        errors=images.errors,
        figures={rate: html.png(figure) for rate, figure in figures.items()},
        commands=commands,
        ran=ran,
    )


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
