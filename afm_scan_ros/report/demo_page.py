"""The results of the demonstration: tables for terminal and JSON, and a page."""

from collections.abc import Iterable, Mapping
from typing import TypeAlias

from attrs import frozen
from matplotlib.figure import Figure

from afm_scan_ros.core.metrics import Figure as Error
from afm_scan_ros.core.metrics import Tracking
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.report import html
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.scan_figures import Images, image_figure
from afm_scan_ros.report.table import Row, Table

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
    rows = [_row(case, done[case]) for case in done if case.name in ("none", "all")]
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


def _row(case: DemoScan, analysis: Analysis) -> dict[str, float | str]:
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
