"""What the demonstration shows: tables for the terminal and as JSON, and a page."""

from collections.abc import Iterable, Mapping
from typing import TypeAlias

from attrs import frozen
from matplotlib.figure import Figure

from afm_scan_ros.core.metrics import Figure as Error
from afm_scan_ros.core.metrics import Tracking
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.report import html
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.table import Row, Table

ABOUT = (
    "A simulated scanner, which its model does not know perfectly, scans 40 µm by 40 µm. Each scan"
    " ran as separate processes and is recorded in a bag. Errors are achieved minus desired"
    " displacement at constant speed, without the sensor's noise, in percent of the range; nothing"
    " is fitted. Without compensation each axis has one gain. 'Measured' includes the noise;"
    " 'mismatch' is trace against retrace; y is taken on trace, and at most over its step."
)


@frozen
class DemoScan:
    """One scan of the demonstration."""

    line_rate: float
    name: str
    inverses: tuple[str, ...]

    @property
    def stem(self) -> str:
        """What its files are called."""
        return f"{self.line_rate:g}hz_{self.name.replace(' ', '_')}"


Scanned: TypeAlias = dict[DemoScan, Analysis]


def tracking(done: Scanned) -> Table:
    """Errors without and with all inverses, at each line rate."""
    columns = {
        "line_rate_hz": ("Hz", "g"),
        "inverses": ("inverses", ""),
        "x_rms": ("x rms", ".3f"),
        "x_measured_rms": ("measured", ".3f"),
        "x_largest": ("x max", ".3f"),
        "mismatch_rms": ("mismatch", ".3f"),
        "y_rms": ("y rms", ".3f"),
        "y_step_largest": ("y step", ".3f"),
    }
    rows = [_row(case, done[case]) for case in done if case.name in ("none", "all")]
    return Table("tracking", "Error in % of the range", columns, rows)


def contributions(done: Scanned, line_rate: float) -> Table:
    """What each inverse does alone, and what is left when it alone is missing."""
    errors = {
        case.name: _percent(_true(analysis).x.constant_speed)
        for case, analysis in done.items()
        if case.line_rate == line_rate
    }
    columns = {
        "inverse": ("inverse", ""),
        "none": ("none, %", ".3f"),
        "alone": ("it alone, %", ".3f"),
        "all_but": ("all but it, %", ".3f"),
        "all": ("all, %", ".3f"),
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
    title = f"Each inverse's own part at {line_rate:g} Hz, x rms in % of the range"
    return Table("contributions", title, columns, rows)


def report(tables: Iterable[Table], figures: Mapping[float, Figure]) -> str:
    """Return everything as one HTML page that needs nothing else."""
    shown = [part for table in tables for part in (html.heading(table.title), _table(table))]
    pictures = [
        html.picture(figure, f"{rate:g} Hz: three lines, without and with compensation")
        for rate, figure in figures.items()
    ]
    title = "A piezoscanner without and with compensation"
    return html.page(title, html.paragraph(ABOUT), *shown, *pictures)


def _table(table: Table) -> str:
    headings = [heading for heading, _ in table.columns.values()]
    forms = {key: form for key, (_, form) in table.columns.items()}
    rows = [[format(row[key], form) for key, form in forms.items()] for row in table.rows]
    return html.table(headings, rows)


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
