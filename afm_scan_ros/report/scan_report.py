"""The reports on one scan, and on the demonstration: tables, pages."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TypeAlias

from attrs import frozen

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.metrics import Figure as Error
from afm_scan_ros.core.metrics import Tracking
from afm_scan_ros.core.model import INVERSES
from afm_scan_ros.report.analysis import Analysis
from afm_scan_ros.report.page import CommandLine, ReportPage, Section
from afm_scan_ros.report.picture import MICRO, Picture
from afm_scan_ros.report.quantity import nanometres, percent
from afm_scan_ros.report.scan_pictures import Images, image_picture, tracking_picture, view_of
from afm_scan_ros.report.sentences import sentence
from afm_scan_ros.report.table import Row, Rows, Table
from afm_scan_ros.report.whole_scan import whole_pictures


def scan_report(analysis: Analysis, recording: ScanRecording) -> ReportPage:
    """Return the report on a recorded scan."""
    return ReportPage(
        title=f"Scan {analysis.name}",
        answer=list(_answer(analysis)),
        picture=tracking_picture(view_of(recording)),
        next_steps=list(_next(analysis)),
        evidence=[
            Section(
                "Errors of each part of the scan",
                [*error_tables(analysis), sentence("scan.method")],
            ),
            Section("The whole scan", list(whole_pictures(recording))),
            Section("What was scanned", [Rows((), scan_rows(analysis))]),
        ],
        warnings=(*analysis.shortcomings, *analysis.warnings),
    )


def _answer(analysis: Analysis) -> Iterator[str]:
    """Yield the errors on the lines, and with which inverses."""
    tracking = analysis.true or analysis.measured
    x, y = tracking.x, tracking.y
    named = {"x at constant speed": (x, x.constant_speed), "y on trace": (y, y.trace)}
    errors = [
        sentence("scan.error_of", name=name, error=error, range=axis.planned_range)
        for name, (axis, error) in named.items()
        if error is not None
    ]
    if errors:
        yield sentence("scan.error", kind=tracking.displacement, errors=errors)
    used = analysis.scan.inverses
    yield sentence("scan.compensated" if used else "scan.uncompensated", inverses=used)


def _next(analysis: Analysis) -> Iterator[str | CommandLine]:
    """Yield what to do; a bag states neither the file of its scan nor that of its model."""
    if analysis.shortcomings:
        yield sentence("scan.repeat")
    words = ["diagnose", analysis.bag, "--out", f"{analysis.name}_diagnosis"]
    yield CommandLine(sentence("scan.diagnose"), words)
    yield sentence("scan.learn")


HEADINGS = ("error", "rms, nm", "rms, %", "peak, nm", "peak, %")

TextRow = tuple[str, ...]


def error_tables(analysis: Analysis) -> Iterator[Rows]:
    """Yield the errors of the true displacement, where it is known, and of the measured one."""
    for tracking in (analysis.true, analysis.measured):
        if tracking is not None:
            title = f"Error of the {tracking.displacement} displacement, % of the planned range"
            yield Rows(HEADINGS, error_rows(tracking), title)


def error_rows(tracking: Tracking) -> list[TextRow]:
    """Return a row for each error; percentages are of the planned range of that axis."""
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
    rows: list[TextRow] = [
        (name, *_sized(of.rms, of.rms_share), *_sized(of.largest, of.largest_share))
        for name, of in named.items()
        if of is not None
    ]
    for axis, error in (("x", x), ("y", y)):
        if split := error.split:
            offset = _sized(split.offset, split.offset / error.planned_range)
            rows.append((f"{axis}, offset", *offset, "", ""))
            rows.append((f"{axis}, gain", "", percent(split.gain), "", ""))
            rows.append((f"{axis}, shape", *_sized(split.shape, split.shape_share), "", ""))
        if (size := error.repeatability) is not None:
            cells = _sized(size, size / error.planned_range)
            rows.append((f"{axis}, line-to-line repeatability", *cells, "", ""))
    return rows


def _sized(size: float, share: float) -> tuple[str, str]:
    return nanometres(size), percent(share)


def scan_rows(analysis: Analysis) -> list[TextRow]:
    """Return what was scanned, and with what, as names and values."""
    scan, spec, drive = analysis.scan, analysis.scan.spec, analysis.drive
    done = analysis.measured
    rows: list[TextRow] = [("scan", scan.scan_id), ("pattern", scan.pattern)]
    if spec is not None:
        rows += [
            ("planned range", _area(spec.range_x, spec.range_y)),
            ("desired on the lines", _area(done.x.peak_to_peak, done.y.peak_to_peak)),
            ("line rate", f"{spec.line_rate:g} Hz, {spec.samples_per_line} samples per line"),
            ("lines", f"{done.lines} of {spec.lines}"),
        ]
    rows += [
        ("samples", f"{done.samples:,} of {scan.total_samples:,}"),
        ("inverses", ", ".join(scan.inverses) or "none"),
        ("model", scan.model_hash[:12] or "none"),
    ]
    if drive is not None:
        rows += [
            ("drive x", f"{drive.lowest_x:.2f} to {drive.highest_x:.2f} V"),
            ("drive y", f"{drive.lowest_y:.2f} to {drive.highest_y:.2f} V"),
        ]
    return rows


def _area(x: float, y: float) -> str:
    return f"{MICRO * x:.4g} µm by {MICRO * y:.4g} µm"


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


def demo_report(
    tables: Sequence[Table],
    compared: Mapping[float, Picture],
    imaged: tuple[DemoScan, Images],
    commands: Iterable[CommandLine],
    ran: str,
) -> ReportPage:
    """Return the report on the demonstration; ``ran`` says how the scans ran."""
    scan, images = imaged
    without, compensated = images.errors
    how = f"at {scan.line_rate:g} Hz with {scan.lines} lines"
    wrong = sentence("demo.image", without=without, compensated=compensated)
    return ReportPage(
        title="A piezoscanner without and with compensation",
        answer=[_improvement(tables[0]), wrong],
        picture=image_picture("grating", images, how),
        next_steps=list(commands),
        evidence=[
            Section(
                "Errors at each line rate, and what each inverse does",
                [table.text() for table in tables],
            ),
            Section("Displacement and error of x and y", list(compared.values())),
            Section("Method", [sentence("demo.method", ran=ran)]),
        ],
    )


def _improvement(tracked: Table) -> str:
    """Say the error of x without and with all inverses, at each line rate."""
    errors = {(row["line_rate_hz"], row["inverses"]): row["x_rms"] for row in tracked.rows}
    rates = sorted({float(rate) for rate, _ in errors})
    pairs = {rate: (errors[rate, "none"], errors[rate, "all"]) for rate in rates}
    return sentence("demo.improvement", errors=pairs)


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
