"""The noise of reversal curves, estimated from the curves alone."""

from collections.abc import Iterable

import numpy as np

from afm_scan_bench.measured.reversal_curve import ReversalCurve
from afm_scan_ros.core.types import Array

MEDIAN_TO_DEVIATION = 1.4826
"""Standard deviation of normal noise over the median of its size."""


def curve_noise(curves: Iterable[ReversalCurve]) -> float:
    """Standard deviation of the points' white noise, in the outputs' unit.

    From how far each point lies from the line between its neighbours, at whatever distances in
    input they are; the median of that, so that the few places where curves bend within three
    points count little. Source: T. Gasser, L. Sroka and C. Jennen-Steinmetz, Biometrika 73 (1986),
    625.
    """
    residuals = np.concatenate([_pseudo_residuals(curve) for curve in curves])
    return MEDIAN_TO_DEVIATION * float(np.median(np.abs(residuals)))


def _pseudo_residuals(curve: ReversalCurve) -> Array:
    """Distances from the line between both neighbours, over what unit noise makes of them."""
    x, y = curve.inputs, curve.outputs
    share = (x[2:] - x[1:-1]) / (x[2:] - x[:-2])
    between = share * y[:-2] + (1.0 - share) * y[2:]
    scale: Array = np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    return (y[1:-1] - between) / scale
