"""Reversal curves freed of an instrument's drift, which repeated visits to saturation show."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_bench.measured.reversal_curve import ReversalCurve
from afm_scan_ros.core.types import Array

NEIGHBOURS = 11
"""Drift points in a running mean: one alone is as noisy as any other point."""


def freed_of_drift(curves: Sequence[ReversalCurve], saturated: Array) -> list[ReversalCurve]:
    """Shift each curve's outputs as saturation has shifted since the first curve.

    ``saturated``, shape (curves,), is the output at one saturation, measured before each curve;
    what is taken for drift is its running mean, over fewer points towards the ends.
    """
    mean = _running_mean(saturated)
    drift = mean - mean[0]
    return [
        evolve(curve, outputs=curve.outputs - shift)
        for curve, shift in zip(curves, drift, strict=True)
    ]


def _running_mean(values: Array) -> Array:
    reach = NEIGHBOURS // 2
    half = [min(k, len(values) - 1 - k, reach) for k in range(len(values))]
    return np.array([values[k - h : k + h + 1].mean() for k, h in enumerate(half)])
