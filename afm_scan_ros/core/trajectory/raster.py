"""Raster: x to and fro at constant speed, y one smooth step after each trace."""

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.shapes import smooth_step, soft_ramp
from afm_scan_ros.core.types import Array


def raster(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[Array, Array]:
    """Displacement in m at sample numbers counted from the first line's start.

    x starts in the middle of a turn-around, at rest at ``-range_x / 2``; before the first line
    and after the last one it rests there.
    """
    inside = samples.clip(0, spec.lines * spec.samples_per_line)
    half = spec.samples_per_line // 2
    way = inside % spec.samples_per_line
    s = np.minimum(way, spec.samples_per_line - way) / half
    return spec.range_x * (soft_ramp(s, spec.turnaround) - 0.5), stepped_y(spec, inside)


def stepped_y(spec: ScanSpec, samples: NDArray[np.int64]) -> Array:
    """Displacement in y, m: ``lines`` levels from ``-range_y / 2`` to ``range_y / 2``."""
    number, age = latest_step(spec, samples)
    done = number + smooth_step(age * (spec.sample_period / spec.y_step))
    return spec.range_y * (np.where(number < 0, 0.0, done) / (spec.lines - 1) - 0.5)


def latest_step(spec: ScanSpec, samples: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array]:
    """Return which y step began last (-1 for none) and how many samples ago.

    A step begins where the trace's constant-speed part ends.
    """
    period = spec.samples_per_line
    first = 0.5 * period * (1.0 - 0.5 * spec.turnaround)
    number = np.floor((samples - first) / period).astype(np.int64).clip(-1, spec.lines - 2)
    age: Array = samples - (number * period + first)
    return number, age
