"""What accuracy and a longer run at constant speed cost in drive voltage, at 250 Hz."""

from attrs import evolve

from afm_scan_bench.curve import TableCurve
from afm_scan_bench.scans import ALL, lines_of, rms_percent, scan, spec_at, tracking
from afm_scan_ros.core.effects.optimal_inverse import RelativeWeight, SmoothWeight
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.report.table import Row, Table

LINE_RATE = 250.0
CORNERS_HZ = (2000.0, 2800.0, 4000.0, 5000.0, 6000.0, 7000.0, 8500.0, 10000.0)
TURNAROUNDS = (0.2, 0.25, 0.3, 0.4, 0.5)

COLUMNS = {
    "constant_speed_percent": ("constant speed, % of half-period", ".0f"),
    "corner_hz": ("weight's corner, Hz", ".0f"),
    "drive_peak_v": ("drive peak on lines, V", ".2f"),
    "x_rms_percent": ("x rms at constant speed, %", ".3f"),
}


def measure() -> Table:
    """Error against peak voltage, along the optimal inverse's weight, for several turn-arounds."""
    rows = []
    for turnaround in TURNAROUNDS:
        spec = evolve(spec_at(LINE_RATE), turnaround=turnaround)
        rows += [found for corner in CORNERS_HZ if (found := row(spec, corner)) is not None]
    title = f"Error against drive at {LINE_RATE:.0f} Hz; what exceeds the range is left out"
    curve = TableCurve("drive_peak_v", "x_rms_percent", by="constant_speed_percent")
    return Table("tradeoff", title, COLUMNS, rows, curve.picture(title, COLUMNS, rows))


def row(spec: ScanSpec, corner: float) -> Row | None:
    """Figures of one scan; None where the drive would leave its limits."""
    try:
        done = scan(spec, ALL, InverseSettings(weight=SmoothWeight(corner, RelativeWeight().order)))
    except ScanError:
        return None
    return {
        "constant_speed_percent": 100.0 * (1.0 - spec.turnaround),
        "corner_hz": corner,
        "drive_peak_v": float(abs(lines_of(spec, done.drive.x)).max()),
        "x_rms_percent": rms_percent(tracking(done).x.constant_speed),
    }
