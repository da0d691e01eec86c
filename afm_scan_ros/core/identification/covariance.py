"""From the scatter of what was measured to 95 % intervals of what was fitted."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from afm_scan_ros.core.types import Array

Interval: TypeAlias = tuple[float, float]
"""Lower and upper end."""
NORMAL_95 = 1.959964
"""97.5th percentile of the standard normal distribution."""
STEP = 1e-6


def sandwich(jacobian: Array, deviation: Array) -> Array:
    """Covariance, (p, p), of parameters that least squares fitted to independent residuals.

    ``jacobian`` is that of the residuals, (n, p), ``deviation`` their standard deviation, (n,):
    they need not all be 1, as the weights may hold more than the scatter does.
    """
    inverse = np.linalg.pinv(jacobian)
    return np.asarray((inverse * deviation**2) @ inverse.T)


def intervals_95(
    figures: Callable[[Array], Array], parameters: Array, covariance: Array
) -> list[Interval]:
    """Interval of each figure of the parameters, by its slope along them."""
    centre = figures(parameters)
    steps = STEP * np.diag(np.maximum(np.abs(parameters), STEP))
    slopes = np.array(
        [(figures(parameters + h) - figures(parameters - h)) / (2.0 * h.sum()) for h in steps]
    )
    half = NORMAL_95 * np.sqrt(np.einsum("pf,pq,qf->f", slopes, covariance, slopes))
    return [(float(c - w), float(c + w)) for c, w in zip(centre, half, strict=True)]
