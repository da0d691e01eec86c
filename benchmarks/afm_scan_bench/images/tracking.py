"""Scans of a drawn scanner with an inverse, and the true error of x.

The sample's drift is left out: it is no motion of the scanner.
"""

from collections.abc import Callable

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike

import afm_scan_ros as afm
from afm_scan_bench.images.acquire import Frame
from afm_scan_bench.images.tube_scanner import TubeScanner
from afm_scan_bench.scans import rms_percent, split_of, tracking
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Array, Trace

Inverse = Callable[[Array, float], Array]
"""From desired displacement (m), (n, 2), and sample period (s) to the drive (V), (n, 2)."""

RATES = (1.0, 10.0, 30.0)
"""Line rates, Hz."""
SHARE = 0.8
"""Of the image's range, so that the drive stays within what the image shows."""
SAMPLE_RATE, FEWEST = 20_000.0, 1000
"""Samples a second, and in a line at the least."""


@frozen
class TrackingError:
    """True error of x at constant speed, % of the range, rms; without its mean beside it."""

    whole: float
    without_offset: float


def spec_of(frame: Frame, line_rate: float) -> afm.ScanSpec:
    """Scan within an image's range, begun at rest; y steps while x turns round."""
    turnaround = 0.1
    return afm.ScanSpec(
        range_x=SHARE * frame.range_x,
        range_y=SHARE * frame.range_y,
        line_rate=line_rate,
        lines=16,
        samples_per_line=max(FEWEST, round(SAMPLE_RATE / line_rate)),
        turnaround=turnaround,
        y_step=0.5 * turnaround / line_rate,
        preparation="none",
        approach=0.5,
    )


def by_gains(gains: ArrayLike) -> Inverse:
    """Return the inverse that takes each axis for one gain (m/V)."""
    return lambda desired, _period: np.asarray(desired / np.asarray(gains))


def linear_inverse(scanner: TubeScanner, frame: Frame) -> Inverse:
    """Return the inverse by the one gain of each axis that fits the slowest scan best."""
    spec, inverse = spec_of(frame, RATES[0]), by_gains(scanner.nominal)
    where = phases(spec).lines
    moving = slice(where.start + spec.samples_per_line, where.stop)
    for _ in range(2):  # the second drives it as far as the scan goes
        done = scanned(scanner, spec, inverse)
        pairs = ((done.drive.x, done.true.x), (done.drive.y, done.true.y))
        inverse = by_gains([np.polyfit(u[moving], x[moving], 1)[0] for u, x in pairs])
    return inverse


def scanned(scanner: TubeScanner, spec: afm.ScanSpec, inverse: Inverse) -> Scan:
    """Scan from rest; the measured displacement is the true one, as there is no sensor."""
    still, period = evolve(scanner, drift=(0.0, 0.0)), spec.sample_period
    desired = afm.trajectory(spec)
    drive = inverse(desired, period)
    _, moved = still.advance(still.at_rest(), np.ascontiguousarray(drive.T), period)
    wanted, driven, achieved = (
        Trace(0, period, *columns) for columns in (desired.T, drive.T, moved)
    )
    return Scan(spec, wanted, driven, achieved, achieved)


def error_of(scanner: TubeScanner, frame: Frame, rate: float, inverse: Inverse) -> TrackingError:
    """Scan at a line rate (Hz) and compare; NaN where the inverse refuses the scan."""
    try:
        done = scanned(scanner, spec_of(frame, rate), inverse)
    except ScanError:
        return TrackingError(np.nan, np.nan)
    error = tracking(done).x
    whole, offset = rms_percent(error.constant_speed), split_of(error).offset
    varying = np.sqrt(whole**2 - (100.0 * offset / error.planned_range) ** 2)
    return TrackingError(whole, float(varying))
