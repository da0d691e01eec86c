"""Error with and without inverting the converter's hold beside G(s)."""

from attrs import evolve

from afm_scan_bench.scans import relative_error, spec_at
from afm_scan_ros.core.effects.optimal_inverse import OptimalInverse, RelativeWeight, optimal_kernel
from afm_scan_ros.core.effects.vibration import SENSOR_SENSITIVITY, Vibration, VibrationModel
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.report.table import Row, Table

VIBRATION_X = VibrationModel(
    tuple(SENSOR_SENSITIVITY * c for c in (0.435, 3910.0, 1.21e7, 1.07e14)),
    (1.0, 8980.0, 2.78e7, 7.38e10, 1.55e14),
)
"""Eq. 5."""
LINE_RATE = 250.0
SAMPLE_RATES = (20e3, 100e3)
INVERTED = {"G(s) alone": False, "G(s) behind the hold": True}

COLUMNS = {
    "sample_rate_hz": ("sample rate, Hz", ".0f"),
    "inverted": ("inverted", ""),
    "rms_percent": ("rms error at constant speed, % of range", ".3f"),
}


def measure() -> Table:
    """Error of a perfectly known vibration model, Eq. 5, driven through the hold."""
    rows: list[Row] = [
        {
            "sample_rate_hz": rate,
            "inverted": name,
            "rms_percent": 100.0 * held_error(rate, hold=hold),
        }
        for rate in SAMPLE_RATES
        for name, hold in INVERTED.items()
    ]
    title = f"The converter's hold, raster at {LINE_RATE:.0f} Hz, perfect model"
    return Table("hold", title, COLUMNS, rows)


def held_error(sample_rate: float, *, hold: bool) -> float:
    """Rms error over range at constant speed when inverting with or without the hold."""
    spec = evolve(spec_at(LINE_RATE), samples_per_line=round(sample_rate / LINE_RATE))
    target = desired(spec, 0, total_samples(spec))
    vibration = Vibration(VIBRATION_X, spec.sample_period)
    weight = RelativeWeight().at(VIBRATION_X.natural_frequency)
    kernel = optimal_kernel(VIBRATION_X.response, weight, spec.sample_period)
    inverse = vibration.inverse if hold else OptimalInverse(kernel, 0)
    drive = inverse.invert_whole(target.x)
    _, achieved = vibration.apply(vibration.at_rest(), drive)
    return relative_error(spec, target.x, achieved)
