"""What it costs when the scanner's resonance is not where the model has it."""

from afm_scan_ros.bench.scans import (
    ALL,
    SAMPLES_AND_TURNAROUND,
    default_plant,
    largest_percent,
    rms_percent,
    scan,
    spec_at,
    tracking,
)
from afm_scan_ros.bench.table import Curve, Table
from afm_scan_ros.simulation.detune import detuned

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
            found = tracking(scan(spec_at(rate), ALL, plant=plant)).x.constant_speed
            rows.append(
                {
                    "line_rate_hz": rate,
                    "shift_percent": shift,
                    "x_rms_percent": rms_percent(found),
                    "x_max_percent": largest_percent(found),
                }
            )
    title = "All inverses on a plant that moved away from its model"
    curve = Curve("shift_percent", "x_rms_percent", by="line_rate_hz", logarithmic=True)
    return Table("mismatch", title, COLUMNS, rows, curve)
