"""The monotone surface nearest to a fitted one."""

import numpy as np

from afm_scan_ros.core.types import Array

SLOPE = 1e-6
"""Least growth from level to level, over the surface's range, for it to have an inverse."""


def nearest_monotone(values: Array) -> Array:
    """Nearest surface that grows strictly with alpha and as beta falls; both (n, n).

    Nearest in its largest change: half-way between the least monotone surface above and the
    greatest below (V. A. Ubhaya, J. Approx. Theory 12 (1974), 146). A monotone surface stays as
    it is; values that are NaN stay so and count for nothing.
    """
    i, j = np.indices(values.shape)
    known = np.isfinite(values) & (i >= j)
    ramp = SLOPE * np.ptp(values[known]) * (i - j)
    bent = np.maximum(values - ramp, 0.0)
    below = np.where(known, bent, 0.0)
    above = np.where(known, bent, np.inf)
    least = np.maximum.accumulate(np.maximum.accumulate(below, axis=0)[:, ::-1], axis=1)[:, ::-1]
    greatest = np.minimum.accumulate(np.minimum.accumulate(above[::-1], axis=0)[::-1], axis=1)
    nearest = np.where(i > j, np.nan, 0.0)
    nearest[known & (i > j)] = ((least + greatest) / 2.0 + ramp)[known & (i > j)]
    return nearest
