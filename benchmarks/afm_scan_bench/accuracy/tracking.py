"""How well the scanner follows, without and with each inverse."""

from afm_scan_bench.scans import (
    ALL,
    SAMPLES_AND_TURNAROUND,
    largest_percent,
    lines_of,
    rms_percent,
    scan,
    spec_at,
    tracking,
)
from afm_scan_ros.report.table import Row, Table

INVERSES = {
    "none": (),
    "creep": ("creep",),
    "hysteresis": ("hysteresis",),
    "vibration": ("vibration",),
    "all": ALL,
}

COLUMNS = {
    "line_rate_hz": ("Hz", ".0f"),
    "inverses": ("inverses", ""),
    "x_rms_percent": ("x rms", ".3f"),
    "x_max_percent": ("x max", ".2f"),
    "gain_over_none": ("gain", ".1f"),
    "x_turnaround_percent": ("turning", ".2f"),
    "mismatch_percent": ("mismatch", ".3f"),
    "y_trace_percent": ("y rms", ".3f"),
    "y_step_max_percent": ("y step", ".2f"),
    "drive_peak_v": ("peak, V", ".2f"),
}


def measure() -> Table:
    """Scan 40 µm at each line rate with each choice of inverses, on the default plant."""
    rows = []
    for rate in SAMPLES_AND_TURNAROUND:
        figures = {name: row(rate, name) for name in INVERSES}
        none = float(figures["none"]["x_rms_percent"])
        rows += [
            {**found, "gain_over_none": none / float(found["x_rms_percent"])}
            for found in figures.values()
        ]
    title = (
        "Error of the true displacement, % of 40 µm, without the first to-and-fro:\n"
        "x rms and max at constant speed, x rms while turning round, mismatch of trace\n"
        "and retrace, y rms on the trace, y max over its step; gain: none over it;\n"
        "peak of the drive on the lines"
    )
    return Table("tracking", title, COLUMNS, rows)


def row(line_rate: float, inverses: str) -> Row:
    """Figures of one scan."""
    spec = spec_at(line_rate)
    done = scan(spec, INVERSES[inverses])
    found = tracking(done)
    return {
        "line_rate_hz": line_rate,
        "inverses": inverses,
        "x_rms_percent": rms_percent(found.x.constant_speed),
        "x_max_percent": largest_percent(found.x.constant_speed),
        "x_turnaround_percent": rms_percent(found.x.turnarounds),
        "mismatch_percent": rms_percent(found.mismatch),
        "y_trace_percent": rms_percent(found.y.trace),
        "y_step_max_percent": largest_percent(found.y.step),
        "drive_peak_v": float(abs(lines_of(spec, done.drive.x)).max()),
    }
