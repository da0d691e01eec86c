"""The figures of a scan as rows of text, for the terminal and for a report alike."""

from collections.abc import Iterator

from afm_scan_ros.core.metrics import AxisError, Figure, Tracking
from afm_scan_ros.report.analysis import Analysis

HEADINGS = ("", "rms, nm", "rms, %", "largest, nm", "largest, %")

Row = tuple[str, ...]


def nanometres(value: float) -> str:
    """Three digits at least of a length in m, in nm."""
    nano = 1e9 * value
    digits = 2 if abs(nano) < 10.0 else 1 if abs(nano) < 100.0 else 0  # noqa: PLR2004 - digits
    return f"{nano:,.{digits}f}"


def percent(share: float) -> str:
    """Return a share of the range in percent."""
    return f"{100.0 * share:.3f}"


def error_rows(tracking: Tracking) -> list[Row]:
    """Return a row for each error; percentages are of the desired peak-to-peak of that axis."""
    named = (*_x(tracking), *_y(tracking.y), *_apart(tracking))
    rows = [_row(name, figure) for name, figure in named if figure is not None]
    for axis, error in (("x", tracking.x), ("y", tracking.y)):
        if error.repeatability is not None:
            share = percent(error.repeatability / error.peak_to_peak)
            rows.append(
                (f"{axis}, from line to line", nanometres(error.repeatability), share, "", "")
            )
    return rows


def scan_rows(analysis: Analysis) -> list[Row]:
    """Return what was scanned, and with what, as names and values."""
    scan, spec, drive = analysis.scan, analysis.scan.spec, analysis.drive
    rows: list[Row] = [("scan", scan.scan_id), ("pattern", scan.pattern)]
    if spec is not None:
        rows += [
            ("range", f"{1e6 * spec.range_x:g} µm by {1e6 * spec.range_y:g} µm"),
            ("line rate", f"{spec.line_rate:g} Hz, {spec.samples_per_line} samples a line"),
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
    yield "x, trace against retrace", tracking.mismatch
    yield "x, constant speed", tracking.x.constant_speed
    yield "x, turn-arounds", tracking.x.turnarounds
    yield "x, all", tracking.x.all


def _y(error: AxisError) -> Iterator[tuple[str, Figure | None]]:
    yield "y, on trace", error.trace
    yield "y, over the step", error.step
    yield "y, all", error.all


def _apart(tracking: Tracking) -> Iterator[tuple[str, Figure | None]]:
    for axis, error in (("x", tracking.x), ("y", tracking.y)):
        yield f"{axis}, first to-and-fro", error.first_line
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
