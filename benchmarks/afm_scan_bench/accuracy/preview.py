"""How far the streaming inverse must look ahead."""

from collections.abc import Sequence

import numpy as np

from afm_scan_bench.curve import TableCurve
from afm_scan_bench.scans import default_model, spec_at
from afm_scan_ros.core.effects.optimal_inverse import OptimalInverse
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Table

LINE_RATE = 250.0
PREVIEWS_MS = (0.0, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0)

COLUMNS = {
    "preview_ms": ("preview, ms", ".1f"),
    "stream_error": ("stream against whole, share of range", ".1e"),
}


def preview_error(inverse: OptimalInverse, targets: Array, previews: Sequence[int]) -> Array:
    """Largest difference between stream and whole at each preview (samples), over the range.

    The range is the peak-to-peak input of the whole; shape (len(previews),).
    """
    whole, behind = inverse.invert_whole(targets), len(inverse.kernel.values)
    streams = (OptimalInverse(inverse.kernel.cut(p, behind), p) for p in previews)
    errors = [np.abs(stream.invert_whole(targets) - whole).max() for stream in streams]
    return np.array(errors) / np.ptp(whole)


def measure() -> Table:
    """Largest difference between stream and whole trajectory, relative to the drive's range."""
    spec = spec_at(LINE_RATE)
    vibration = Vibration(default_model().axis("x").vibration, spec.sample_period)
    previews = [round(1e-3 * ms / spec.sample_period) for ms in PREVIEWS_MS]
    targets = desired(spec, 0, total_samples(spec)).x
    errors = preview_error(vibration.inverse, targets, previews)
    rows = [
        {"preview_ms": ms, "stream_error": float(error)}
        for ms, error in zip(PREVIEWS_MS, errors, strict=True)
    ]
    title = f"Preview of the streaming inverse, raster at {LINE_RATE:.0f} Hz"
    curve = TableCurve("preview_ms", "stream_error", logarithmic=True)
    return Table("preview", title, COLUMNS, rows, curve.picture(title, COLUMNS, rows))
