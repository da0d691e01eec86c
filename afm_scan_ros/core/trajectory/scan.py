"""The whole desired trajectory, any run of its samples at a time.

A pattern is defined for every sample number, before its first line and after its last one too;
the approach and the settling are that continuation under an envelope that rises from 0 to 1 and
falls back. So they join without a jump in position, nor in velocity where the pattern itself has
none, and never leave the scan's range.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.patterns import lissajous, raster, sinusoidal, spiral
from afm_scan_ros.core.trajectory.phases import (
    approach_samples,
    phases,
    preparation,
    settle_samples,
)
from afm_scan_ros.core.trajectory.shapes import smooth_step
from afm_scan_ros.core.types import Array, Trace

Pattern = Callable[[ScanSpec, NDArray[np.int64]], tuple[Array, Array]]

PATTERN: Mapping[str, Pattern] = {
    "raster": raster,
    "sinusoidal": sinusoidal,
    "spiral": spiral,
    "lissajous": lissajous,
}


def desired(spec: ScanSpec, first: int, count: int) -> Trace:
    """Desired displacement in m of samples ``first`` to ``first + count - 1``.

    A function of the sample numbers alone, so that any cut into blocks gives the same values.
    Samples after the scan's end rest at zero.
    """
    x, y = _displacement(spec, np.arange(first, first + count, dtype=np.int64))
    return Trace(first, spec.sample_period, x, y)


def stopped(spec: ScanSpec, stop: int, first: int, count: int) -> Trace:
    """Desired displacement, m, of a scan that an operator stops at sample ``stop``.

    The scan goes on under an envelope that falls smoothly to zero within its settling time: it
    neither jumps nor leaves the range, whatever its position and velocity were.
    """
    samples = np.arange(first, first + count, dtype=np.int64)
    x, y = _displacement(spec, samples)
    envelope = 1.0 - smooth_step((samples - stop) / settle_samples(spec))
    return Trace(first, spec.sample_period, envelope * x, envelope * y)


def stopped_total(spec: ScanSpec, stop: int) -> int:
    """Samples in a scan that is stopped at sample ``stop``; the last one is at rest at zero."""
    return min(phases(spec).total, stop + settle_samples(spec) + 1)


def _displacement(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at consecutive sample numbers: preparation, pattern, then zero."""
    where = phases(spec)
    x, y = np.zeros(samples.size), np.zeros(samples.size)
    early, over = np.searchsorted(samples, (where.preparation.stop, where.total))
    if early:
        x[:early] = y[:early] = preparation(spec, samples[:early])
    if over > early:
        numbers = samples[early:over] - where.lines.start
        pattern_x, pattern_y = PATTERN[spec.pattern](spec, numbers)
        envelope = _envelope(spec, numbers)
        x[early:over], y[early:over] = envelope * pattern_x, envelope * pattern_y
    return x, y


def _envelope(spec: ScanSpec, samples: NDArray[np.int64]) -> Array | float:
    """Rise over the approach and fall over the settling; exactly 1 on the lines."""
    end = spec.lines * spec.samples_per_line
    if samples[0] >= 0 and samples[-1] <= end:
        return 1.0
    rise = smooth_step(1.0 + samples / approach_samples(spec))
    return rise * (1.0 - smooth_step((samples - end) / settle_samples(spec)))
