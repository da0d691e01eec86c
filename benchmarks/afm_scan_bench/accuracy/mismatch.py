"""What it costs when resonance and damping both are not where the model has them."""

from afm_scan_bench.accuracy.robustness import errors
from afm_scan_bench.curve import TableCurve
from afm_scan_bench.detune import detuned
from afm_scan_bench.scans import SAMPLES_AND_TURNAROUND, default_plant, spec_at
from afm_scan_ros.report.table import Table

SHIFTS_PERCENT = (-5, -3, -1, 0, 1, 3, 5)

COLUMNS = {
    "line_rate_hz": ("line rate, Hz", ".0f"),
    "shift_percent": ("plant's resonance and damping off by, %", "+d"),
    "x_rms_percent": ("x rms at constant speed, %", ".3f"),
    "x_max_percent": ("x max, %", ".2f"),
}


def measure() -> Table:
    """Scan plants whose first resonance and its damping are off, with all inverses."""
    rows = []
    for rate in SAMPLES_AND_TURNAROUND:
        for shift in SHIFTS_PERCENT:
            factor = 1.0 + shift / 100.0
            plant = detuned(default_plant(), frequency=factor, damping=factor)
            found = errors(spec_at(rate), plant)
            rows.append({"line_rate_hz": rate, "shift_percent": shift, **found})
    title = "All inverses on a plant that moved away from its model"
    curve = TableCurve("shift_percent", "x_rms_percent", by="line_rate_hz", logarithmic=True)
    return Table("mismatch", title, COLUMNS, rows, curve.picture(title, COLUMNS, rows))
